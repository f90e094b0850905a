#include "client/station/window/screens/lesson_screen.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <fmt/core.h>
#include <imgui/imgui.h>

#include <algorithm>
#include <span>
#include <string>
#include <string_view>

#include "client/device/hand/hand_options.h"
#include "client/station/run/lesson/trainee_code.h"
#include "client/station/run/loop/fault_watch.h"
#include "client/station/window/lessons/start_choice.h"
#include "client/station/window/screens/station_actions.h"
#include "client/view/action_bar.h"
#include "client/view/model/palette.h"
#include "client/view/model/plot.h"
#include "client/view/theme.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {

// --- the screen ---

namespace {

struct KeyRow {
  const char* keys;
  const char* does;
};
constexpr KeyRow kSteeringKeys[] = {{"W S, wheel", "in, out"},           {"arrows, drag", "across"},
                                    {"Ctrl+arrows, right drag", "tilt"}, {"L", "line up with the plan"},
                                    {"Space, X", "plunger in, out"},     {"Shift", "slowly"}};
constexpr KeyRow kLessonKeys[] = {{"H", "show me"},
                                  {"1 2 3 4", "views"},
                                  {"Ctrl + −", "letter size"},
                                  {"F2", "ask an instructor for help"},
                                  {"I", "this window"},
                                  {"Esc", "end"}};

// shows the facts behind the light, and all keys, over the picture
void showDetails(std::span<const StationFact> facts, bool steers, ImVec2 corner_px, ImVec2 size_px) {
  ImGui::SetNextWindowPos({corner_px.x + space(), corner_px.y + space()});
  ImGui::SetNextWindowSize({size_px.x - 2 * space(), 0});
  ImGui::SetNextWindowBgAlpha(0.94F);
  ImGui::PushStyleColor(ImGuiCol_Border, colourOf(kLineGrey));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 2);
  if (ImGui::Begin("##details", nullptr, kLaidOver | ImGuiWindowFlags_NoInputs)) {
    showFacts(facts);
    ImGui::Separator();
    if (steers)
      for (const KeyRow& row : kSteeringKeys) keyHint(row.keys, row.does);
    for (const KeyRow& row : kLessonKeys) keyHint(row.keys, row.does);
  }
  ImGui::End();
  ImGui::PopStyleVar();
  ImGui::PopStyleColor();
}

int keyAxis(int plus, int minus) {
  return (ImGui::IsKeyDown(plus) ? 1 : 0) - (ImGui::IsKeyDown(minus) ? 1 : 0);
}

// a lesson from a profile file has no exercise
std::string titleOf(const LessonFollow& lesson) {
  const auto& exercise = lesson.beginning().lesson.exercise;
  return (lesson.beginning().lesson.exam ? "Exam: " : "") +
         (exercise ? exercise->name() : lesson.beginning().lesson.profile.name());
}

// not in an exam; with the needle in tissue a trainee has other things to look at
bool mayDemonstrate(const LessonFollow& lesson) {
  return !lesson.beginning().lesson.exam && !(lesson.begun() && lesson.now().inside);
}

// what a demonstration shows, with any aids of the exercise
AidSet demonstrationAids() {
  AidSet aids = usualAidSet();
  aids.set(pb::Exercise::ALIGNMENT, false);
  return aids;
}

}  // namespace

void LessonScreen::showHead(const BoardState& state, const LessonFollow& lesson) const {
  const LessonBeginning& beginning = lesson.beginning();
  const auto& left_s = state.status.left_s;
  {
    const WithFont heading(Letters::kHeading);
    std::string clock = clockText(left_s.value_or(state.status.time_s));
    if (left_s) clock += state.status.limit_runs ? " left" : " from the first contact";
    const float wide = ImGui::CalcTextSize(clock.c_str()).x;
    const float x = ImGui::GetContentRegionAvail().x;
    textLine(titleOf(lesson), x - wide - 3 * space());
    ImGui::SameLine(x - wide + ImGui::GetStyle().WindowPadding.x);
    const WithTextColour colour(left_s && *left_s < 10 ? kOrange : kText);
    ImGui::TextUnformatted(clock.c_str());
  }
  if (demonstration_.isOn()) {
    const WithTextColour colour(kSkyBlue);
    textLine(demonstration_.shown() != nullptr
                 ? "This is a demonstration by a simulated hand. Your own needle waits where it was."
                 : "The demonstration is being computed …");
    return;
  }
  const bool steps = AidSet(state.aids).has(pb::Exercise::STEPS);
  if (lesson.begun() && isCapped(lesson.now()) && !steps) {
    const WithTextColour colour(styleOf(Condition::kAttention).colour);
    textBlock(capText(lesson.scene()->landmark));
    return;
  }
  const WithTextColour colour(beginning.code_unchecked ? styleOf(Condition::kAttention).colour : kDimText);
  const std::string line = lessonLine(beginning, !steps);
  textBlock(AidSet(state.aids).has(pb::Exercise::ALARMS) ? line : "by feel, without alarms; " + line);
}

// the exercise's words say the same as the steps
void LessonScreen::showSteps(const BoardState& state, const LessonFollow& lesson) {
  if (!steps_ || demonstration_.isOn() || !lesson.begun() || !AidSet(state.aids).has(pb::Exercise::STEPS))
    return;
  const SteerView view{frame_.camera.right_W(), frame_.camera.upward_W()};
  stepStrip(steps_->next(stepFactsOf(lesson, state.status, lesson.beginning().way, anatomy_, view)));
}

std::string capText(const std::string& landmark) {
  return fmt::format(
      "The needle is capped. Feel for {}, lift the needle off the skin, then press C or the third button",
      landmark.empty() ? "the landmarks" : "the " + landmark);
}

std::string lessonLine(const LessonBeginning& beginning, bool description) {
  std::string who = beginning.trainee;
  if (beginning.code_unchecked) return who + ": " + kCodeUnchecked;
  if (beginning.lesson.attempt > 0) who += fmt::format(", attempt {}", beginning.lesson.attempt);
  if (beginning.lesson.attempts_left)
    who += fmt::format(" ({} left, this one included)", *beginning.lesson.attempts_left);
  if (description && beginning.lesson.exercise && !beginning.lesson.exercise->description().empty())
    who += ": " + beginning.lesson.exercise->description();
  return who;
}

void LessonScreen::begin(const LessonFollow& lesson) {
  renderer_.setScene(lesson.scene());
  frame_ = SceneFrame{};
  frame_.camera = initialView(*lesson.scene());
  steering_.reset();
  if (lesson.beginning().steering)
    steering_.emplace(SteeringTarget{steeredStart(lesson.beginning().way).start().X_WT,
                                     steeredStart(lesson.beginning().way).start().plunger});
  const StationLesson& what = lesson.beginning().lesson;
  const auto asksFor = [&](std::string_view measure) {
    return what.exercise && std::ranges::any_of(what.exercise->requirements(), [&](const auto& requirement) {
             return requirement.measure() == measure;
           });
  };
  anatomy_ = anatomyOf(what.profile, lesson.beginning().X_WL);
  steps_.reset();
  if (!what.exam)
    steps_.emplace(steering_.has_value(),
                   asksFor("injected_in_target_share") || asksFor("aspirated_before_injection"),
                   lesson.scene()->landmark,
                   anatomy_.targets.empty() ? std::string() : anatomy_.targets.front().ball.name);
  demonstration_.begin();
  held_across_ = held_tilt_ = shows_details_ = false;
}

void LessonScreen::show(const BoardState& state, const LessonFollow& lesson, bool keys,
                        LessonRequests& requests) {
  keys_ = keys;
  beginScreen("lesson");
  if (keys && ImGui::IsKeyPressed(GLFW_KEY_H, false) && mayDemonstrate(lesson)) {
    if (demonstration_.isOn())
      demonstration_.stop();
    else
      demonstration_.play(lesson);
  }
  demonstration_.advance(lesson, static_cast<double>(ImGui::GetIO().DeltaTime));
  const bool plays = demonstration_.shown() != nullptr;
  const LessonFollow& shown = plays ? *demonstration_.shown() : lesson;
  const AidSet aids = plays ? demonstrationAids() : AidSet(state.aids);
  showHead(state, lesson);
  showSteps(state, lesson);
  const float foot = 3.4F * space();
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  // large letters need a wider panel, but the picture remains the larger part
  const float panel = std::max(0.34F * rest.x, std::min(0.46F * rest.x, 42 * space()));
  const ImVec2 picture{rest.x - panel - gap, rest.y - foot};
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  ImGui::BeginGroup();
  const bool hovered = showScene(shown, aids, picture);
  if (steering_) steer(lesson, hovered);
  lessonAlarms(state.status.alarms, corner, picture);
  ImGui::EndGroup();
  ImGui::SameLine();
  ImGui::BeginGroup();
  const bool clicked = lessonPanel(state, shown, aids, ultrasound_, {panel, picture.y});
  ImGui::EndGroup();
  if (steering_) {
    keyHint("W S", "in, out");
    ImGui::SameLine();
    keyHint("arrows", "across");
    ImGui::SameLine();
    keyHint("Ctrl+arrows", "tilt");
    ImGui::SameLine();
    keyHint("Space X", "plunger");
    ImGui::SameLine();
    keyHint("L", "line up");
    ImGui::SameLine();
    if (keys && ImGui::IsKeyPressed(GLFW_KEY_L, false)) lineUp(lesson);
  }
  if (lesson.beginning().lesson.model.isLive(Effect::kPalpation)) {
    keyHint("C", isCapped(lesson.now()) ? "cap off" : "cap on");
    ImGui::SameLine();
    if (keys && ImGui::IsKeyPressed(GLFW_KEY_C, false)) requests.switchCap();
  }
  keyHint("1–4", "views");
  ImGui::SameLine();
  keyHint("I", "all keys");
  ImGui::SameLine();
  keyHint("Esc", "end");
  if (clicked || (keys && ImGui::IsKeyPressed(GLFW_KEY_I, false))) shows_details_ = !shows_details_;
  lessonMessages(state, corner, picture);
  showDemonstration(lesson, corner, picture);
  // alarms and messages take precedence
  if (shows_details_ && !hasFreshMessage(state) && overlayOf(state.status).kind == Overlay::Kind::kNone)
    showDetails(lessonFacts(state, lesson.beginning(), lesson.dropped(), lesson.now().alpha_rad),
                steering_.has_value(), corner, picture);
  lessonOverlay(state.status, keys && !end_question_.asked(), fault_gate_, requests, corner, picture);
  if (keys) offerEnd(lesson.beginning().lesson, requests);
  endScreen();
}

// a button in the picture's corner, while the needle is not in tissue
void LessonScreen::showDemonstration(const LessonFollow& lesson, ImVec2 corner_px, ImVec2 size_px) {
  if (!mayDemonstrate(lesson)) return demonstration_.stop();
  ImGui::SetNextWindowPos({corner_px.x + size_px.x - space(), corner_px.y + space()}, ImGuiCond_Always,
                          {1, 0});
  ImGui::SetNextWindowBgAlpha(0.88F);
  if (ImGui::Begin("##demonstration", nullptr, kLaidOver)) {
    if (!demonstration_.trouble().empty()) {
      textLine("no demonstration: " + demonstration_.trouble());
    } else if (demonstration_.isOn()) {
      if (ImGui::Button("Stop   [H]")) demonstration_.stop();
      levelBar(demonstration_.progress(), "", kSkyBlue, 12 * space());
    } else if (ImGui::Button("Show me   [H]")) {
      demonstration_.play(lesson);
    }
  }
  ImGui::End();
}

bool LessonScreen::showScene(const LessonFollow& lesson, const AidSet& aids, ImVec2 size_px) {
  chooseView(lesson);
  frame_.moment = lesson.now();
  frame_.show_needle = lesson.begun();
  frame_.aids = aids;
  frame_.plan_W = lesson.plan_W();
  SceneWidgetOptions options;
  // steering a hand uses the mouse; with Alt it rotates the picture instead
  options.mouse_moves_camera = !steering_ || ImGui::GetIO().KeyAlt;
  const SceneWidgetResult result = sceneWidget("scene", renderer_, frame_, size_px, options);
  return result.hovered;
}

void LessonScreen::chooseView(const LessonFollow& lesson) {
  if (ImGui::IsKeyPressed(GLFW_KEY_1, false)) frame_.camera = initialView(*lesson.scene());
  if (ImGui::IsKeyPressed(GLFW_KEY_2, false)) frame_.camera = viewFromSide(*lesson.scene());
  if (ImGui::IsKeyPressed(GLFW_KEY_3, false)) frame_.camera = viewFromAbove(*lesson.scene());
  if (ImGui::IsKeyPressed(GLFW_KEY_4, false)) frame_.camera = viewOfWhole(*lesson.scene());
}

// sends this frame's mouse and key input to the hand
void LessonScreen::steer(const LessonFollow& lesson, bool hovered) {
  const ImGuiIO& io = ImGui::GetIO();
  const bool asks = end_question_.asked() || !keys_;
  const bool mouse = !io.KeyAlt && !asks;
  // a drag from inside the picture continues beyond its edge
  if (!ImGui::IsMouseDown(ImGuiMouseButton_Left)) held_across_ = false;
  if (!ImGui::IsMouseDown(ImGuiMouseButton_Right)) held_tilt_ = false;
  if (hovered && mouse && ImGui::IsMouseClicked(ImGuiMouseButton_Left)) held_across_ = true;
  if (hovered && mouse && ImGui::IsMouseClicked(ImGuiMouseButton_Right)) held_tilt_ = true;

  SteerInput input;
  input.dt_s = static_cast<double>(io.DeltaTime);
  input.fine = io.KeyShift;
  if (held_across_)
    input.across_right_px = static_cast<double>(io.MouseDelta.x),
    input.across_up_px = -static_cast<double>(io.MouseDelta.y);
  if (held_tilt_)
    input.tilt_right_px = static_cast<double>(io.MouseDelta.x),
    input.tilt_up_px = -static_cast<double>(io.MouseDelta.y);
  if (hovered && mouse) input.wheel = static_cast<double>(io.MouseWheel);
  if (!io.WantTextInput && !asks) {
    input.advance = keyAxis(GLFW_KEY_W, GLFW_KEY_S);
    const int right = keyAxis(GLFW_KEY_RIGHT, GLFW_KEY_LEFT), up = keyAxis(GLFW_KEY_UP, GLFW_KEY_DOWN);
    (io.KeyCtrl ? input.tilt_right : input.across_right) = right;
    (io.KeyCtrl ? input.tilt_up : input.across_up) = up;
    input.press = ImGui::IsKeyDown(GLFW_KEY_SPACE);
    input.draw = ImGui::IsKeyDown(GLFW_KEY_X);
  }
  const SteerView view{frame_.camera.right_W(), frame_.camera.upward_W()};
  if (input.moves()) demonstration_.stop();
  const Vec3 tip = lesson.begun() ? lesson.now().p_WT_m : steering_->target().X_WT.p;
  lesson.beginning().steering->setTarget(steering_->update(input, view, tip));
}

// clear of the skin, which it would tear otherwise
void LessonScreen::lineUp(const LessonFollow& lesson) {
  if (lesson.begun() && lesson.now().depth_m < -lesson.scene()->cap_radius_m)
    steering_->lineUp(steeredStart(lesson.beginning().way).start().X_WT);
}

// asks first, because a single key press could end a lesson by mistake
void LessonScreen::offerEnd(const StationLesson& lesson, LessonRequests& requests) {
  if (ImGui::IsKeyPressed(GLFW_KEY_ESCAPE, false) && !end_question_.asked())
    end_question_.ask(lesson.exam ? "End this exam?" : "End this lesson?");
  if (end_question_.show("Everything up to here is kept and scored.", endLessonActions(lessonWord(lesson))) ==
      kActYes)
    requests.stop({});
}

}  // namespace needlelab
