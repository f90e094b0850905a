#include "client/station/window/screens/station_actions.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <fmt/core.h>
#include <imgui/imgui.h>

#include <algorithm>

#include "client/station/window/lessons/start_choice.h"
#include "client/view/theme.h"
#include "common/base/units.h"

namespace needlelab {

std::vector<ScreenAction> startActions(bool can_begin, bool may_quit) {
  std::vector<ScreenAction> actions = {{kActBegin, "Begin", ActionKey::kEnter, "begin", can_begin},
                                       {kActLook, "Check again", ActionKey::kNone, "", true}};
  if (may_quit) actions.push_back({kActQuit, "Quit", ActionKey::kNone, "", true});
  return actions;
}

std::vector<ScreenAction> endActions(const BoardState& state, bool may_quit) {
  std::vector<ScreenAction> actions;
  if (state.next)
    actions.push_back(
        {kActNext, "Next: " + exerciseName(state.lists, state.next->exercise) + " (" + state.next->from + ")",
         ActionKey::kEnter, "the next exercise", true});
  const bool was_last = state.beginning && state.beginning->lesson.attempts_left.value_or(2) <= 1;
  if (!was_last)
    actions.push_back({kActAgain, "Next try", state.next ? ActionKey::kNone : ActionKey::kEnter,
                       state.next ? "" : "next try", true});
  actions.push_back({kActOther, "Other exercise", actions.empty() ? ActionKey::kEnter : ActionKey::kO,
                     "other exercise", true});
  if (may_quit) actions.push_back({kActQuit, "Quit", ActionKey::kNone, "", true});
  return actions;
}

int replaySteps() {
  keyHint("← →", "last insertion, step by step");
  return (ImGui::IsKeyPressed(GLFW_KEY_RIGHT) ? 1 : 0) - (ImGui::IsKeyPressed(GLFW_KEY_LEFT) ? 1 : 0);
}

int endActionByKey(int action, bool characters_typed) {
  const bool begins = action == kActNext || action == kActAgain;
  return characters_typed && begins ? kActOther : action;
}

std::vector<ScreenAction> failedActions(bool may_quit) {
  if (!may_quit) return {};
  return {{kActQuit, "Quit", ActionKey::kEnter, "", true}};
}

std::vector<ScreenAction> faultActions() {
  return {{kActSeen, "Acknowledge", ActionKey::kEnter, "", true}};
}

std::vector<ScreenAction> beginExamActions() {
  return {{kActNo, "Not now", ActionKey::kEnterOrEscape, "", true},
          {kActYes, "Begin exam", ActionKey::kDelete, "", true}};
}

std::vector<ScreenAction> endLessonActions(const std::string& what) {
  return {{kActNo, "Continue", ActionKey::kEnterOrEscape, "", true},
          {kActYes, "End " + what, ActionKey::kDelete, "", true}};
}

std::string lessonWord(const StationLesson& lesson) {
  return lesson.exam ? "exam" : "lesson";
}

std::vector<ScreenAction> quitActions() {
  return {{kActNo, "Stay", ActionKey::kEnterOrEscape, "", true},
          {kActYes, "Quit", ActionKey::kDelete, "", true}};
}

std::string quitText(const BoardState& state) {
  const std::string the_lesson = "The " + (state.beginning ? lessonWord(state.beginning->lesson) : "lesson");
  switch (state.stage) {
    case Stage::kLesson:
      return the_lesson + " ends now. Everything up to here is kept and scored.";
    case Stage::kPreparing:
      return "The lesson being prepared will not start.";
    case Stage::kConcluding:
    case Stage::kEnd:
      if (state.outcome && !state.outcome->stored.ok())
        return the_lesson + " is over. " + state.outcome->stored.error().message;
      return the_lesson + " is over. Its recording is kept.";
    case Stage::kOpening:
    case Stage::kStart:
    case Stage::kClosing:
    case Stage::kFailed:
      break;
  }
  return "No lesson is running.";
}

StationFact serverFact(const std::string& server) {
  const bool waits = server.starts_with("server away") || server.starts_with("server has no room") ||
                     server == "server refuses";
  return {waits ? Condition::kAttention : Condition::kGood, server};
}

std::vector<StationFact> lessonFacts(const BoardState& state, const LessonBeginning& beginning,
                                     std::uint64_t dropped, double alpha_rad) {
  const LessonStatus& s = state.status;
  const double missed_share =
      s.time_s > 0 ? static_cast<double>(s.missed_ticks) / (s.time_s * beginning.rate_hz) : 0;
  std::vector<StationFact> facts;
  facts.push_back({missed_share > 0.01    ? Condition::kTrouble
                   : missed_share > 0.001 ? Condition::kAttention
                                          : Condition::kGood,
                   fmt::format("loop {:.0f} Hz: 99 % within {:.0f} µs, {} missed", beginning.rate_hz,
                               1e-3 * static_cast<double>(s.wakeup.p99_ns), s.missed_ticks)});
  const bool recording = s.spool.empty() || s.spool == "recording";
  facts.push_back({recording ? Condition::kGood : Condition::kTrouble, recording ? "recording" : s.spool});
  if (!s.server.empty()) facts.push_back(serverFact(s.server));
  if (!s.room.empty()) facts.push_back({Condition::kTrouble, s.room});
  if (dropped > 0)
    facts.push_back({Condition::kAttention,
                     fmt::format("this picture left out {} samples; the recording has them", dropped)});
  if (!state.aids_by.empty()) facts.push_back({Condition::kUnknown, state.aids_by + " chose what is shown"});
  facts.push_back({Condition::kUnknown, fmt::format("tilt limit α {:.0f}°", degreesOf(alpha_rad))});
  for (const std::string& note : beginning.device_notes) facts.push_back({Condition::kUnknown, note});
  return facts;
}

Condition lightOf(std::span<const StationFact> facts) {
  Condition worst = Condition::kGood;
  for (const StationFact& fact : facts) worst = std::max(worst, fact.condition);
  return worst;
}

const char* lightText(Condition light) {
  return light <= Condition::kGood ? "Station OK" : "Check station";
}

bool stationLight(Condition light) {
  ImGui::BeginGroup();
  conditionLine(light, lightText(light));
  ImGui::SameLine();
  keyHint("I", "more");
  ImGui::EndGroup();
  return ImGui::IsItemClicked();
}

void showFacts(std::span<const StationFact> facts) {
  for (const StationFact& fact : facts) conditionLine(fact.condition, fact.words);
}

}  // namespace needlelab
