#include <fmt/core.h>
#include <imgui/imgui.h>

#include <algorithm>
#include <string>

#include "client/station/run/loop/fault_watch.h"
#include "client/station/window/lessons/start_choice.h"
#include "client/station/window/screens/lesson_screen.h"
#include "client/station/window/screens/station_actions.h"
#include "client/view/action_bar.h"
#include "client/view/model/palette.h"
#include "client/view/theme.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {

// --- no force: cause and advice ---

namespace {

std::string sentence(std::string text) {
  if (!text.empty()) text.front() = upperCase(text.front());
  if (!text.empty() && text.back() != '.') text += '.';
  return text;
}

Overlay faultOverlay(const LessonStatus& status) {
  Overlay overlay;
  overlay.kind = Overlay::Kind::kFault;
  overlay.title = "The force was taken away";
  overlay.what = sentence(faultText(status.fault));
  if (!status.device_status.empty()) overlay.what += " " + sentence(status.device_status);
  const std::string remedy = remedyOf(status.fault);
  if (!status.waits || status.fault == Fault::kProgramTrouble)
    overlay.todo = "The lesson ends; everything up to here is stored.";
  else if (status.acknowledged)
    overlay.todo = "Acknowledged. Take the needle out of the tissue, and the force comes back.";
  else if (status.cause_lasts)
    overlay.todo = "First " + (remedy.empty() ? std::string("wait until the cause is gone") : remedy) +
                   ". Then take the needle out of the tissue and press Enter.";
  else {
    overlay.todo = "Take the needle out of the tissue, then press Enter: the force comes back.";
    overlay.can_acknowledge = true;
  }
  return overlay;
}

}  // namespace

Overlay overlayOf(const LessonStatus& status) {
  if (status.fault != Fault::kNone) return faultOverlay(status);
  if (status.hold.empty()) return {};
  Overlay overlay;
  overlay.kind = Overlay::Kind::kHold;
  overlay.title = "No force at the moment";
  overlay.what = sentence(status.device_status.empty() ? status.hold : status.device_status);
  if ((status.condition & kDeviceReleased) != 0)
    overlay.todo = "Take the handle: the force comes back by itself.";
  else if ((status.condition & kDevicePowerOff) != 0)
    overlay.todo = "Switch the device's motors on: the force comes back by itself.";
  else if ((status.condition & kDeviceNotReady) != 0)
    overlay.todo = "Wait a moment: the force comes when the device is ready.";
  else
    overlay.todo = "Take the needle out of the tissue, and the force comes.";
  return overlay;
}

// --- over the picture ---

namespace {

constexpr std::size_t kMessagesShown = 2;
constexpr double kFresh_s = 20;

}  // namespace

bool hasFreshMessage(const BoardState& state) {
  return !state.messages.empty() && state.messages.back().lesson_s + kFresh_s > state.status.time_s;
}

void lessonOverlay(const LessonStatus& status, bool keys, AnswerGate& gate, LessonRequests& requests,
                   ImVec2 corner_px, ImVec2 size_px) {
  const Overlay overlay = overlayOf(status);
  const bool fault = overlay.kind == Overlay::Kind::kFault;
  // another fault is a new question
  const bool answerable = gate.opens(fault ? static_cast<int>(status.fault) : 0, /*hidden=*/1);
  if (overlay.kind == Overlay::Kind::kNone) return;
  const auto actions = faultActions();
  if (answerable && keys && actionByKey(actions) == kActSeen) requests.acknowledge();

  const Condition condition = fault ? Condition::kTrouble : Condition::kAttention;
  const float width = std::min(0.94F * size_px.x, 72 * space());
  // a fault in the middle; a hold at the top, where it hides least
  ImGui::SetNextWindowPos(
      {corner_px.x + 0.5F * size_px.x, corner_px.y + (fault ? 0.5F * size_px.y : space())}, ImGuiCond_Always,
      {0.5F, fault ? 0.5F : 0.0F});
  ImGui::SetNextWindowSize({width, 0});
  ImGui::SetNextWindowBgAlpha(0.94F);
  ImGui::PushStyleColor(ImGuiCol_Border, colourOf(styleOf(condition).colour));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 3);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {2 * space(), 1.5F * space()});
  if (ImGui::Begin("##overlay", nullptr, kLaidOver)) {
    {
      const WithFont heading(Letters::kHeading);
      conditionLine(condition, overlay.title);
      textBlock(overlay.what);
      ImGui::Spacing();
      textBlock(overlay.todo);
    }
    if (overlay.can_acknowledge) {
      ImGui::Spacing();
      ImGui::BeginDisabled(!answerable);
      if (actionButtons(actions, 0, true) == kActSeen) requests.acknowledge();
      ImGui::EndDisabled();
    }
  }
  ImGui::End();
  ImGui::PopStyleVar(2);
  ImGui::PopStyleColor();
}

void lessonAlarms(const std::vector<ActiveAlarm>& alarms, ImVec2 corner_px, ImVec2 size_px) {
  constexpr std::size_t kMaxShown = 3;
  ImDrawList* const draw = ImGui::GetWindowDrawList();
  draw->PushClipRect(corner_px, {corner_px.x + size_px.x, corner_px.y + size_px.y}, true);
  float top = corner_px.y;
  bool danger = false;
  for (std::size_t i = 0; i < std::min(alarms.size(), kMaxShown); ++i) {
    const AlarmKind& kind = kindOf(alarms[i].alarm);
    danger = danger || kind.danger;
    const Rgb letters = kind.danger ? kWhite : kBlack;
    const WithFont large(i == 0 ? Letters::kFigure : Letters::kHeading);
    const float height = ImGui::GetTextLineHeight() + space(), low = top + height - 0.6F * space();
    draw->AddRectFilled({corner_px.x, top}, {corner_px.x + size_px.x, top + height},
                        packed(kind.danger ? kVermillion : kOrange));
    const std::string word(kind.word);
    const float x = corner_px.x + space(), after = x + ImGui::CalcTextSize(word.c_str()).x + 1.5F * space();
    draw->AddText({x, top + 0.5F * space()}, packed(letters), word.c_str());
    const WithFont smaller(i == 0 ? Letters::kHeading : Letters::kBody);
    draw->AddText({after, low - ImGui::GetTextLineHeight()}, packed(letters),
                  fittedText(alarms[i].detail, corner_px.x + size_px.x - space() - after).c_str());
    top += height;
  }
  if (!alarms.empty())
    draw->AddRect(corner_px, {corner_px.x + size_px.x, corner_px.y + size_px.y},
                  packed(danger ? kVermillion : kOrange), 0, 0, 0.6F * space());
  draw->PopClipRect();
}

void lessonMessages(const BoardState& state, ImVec2 corner_px, ImVec2 size_px) {
  if (state.messages.empty() && !state.next) return;
  ImGui::SetNextWindowPos({corner_px.x + space(), corner_px.y + size_px.y - space()}, ImGuiCond_Always,
                          {0, 1});
  const bool fresh = hasFreshMessage(state);
  ImGui::SetNextWindowSize({(fresh ? 0.94F : 0.62F) * size_px.x, 0});
  ImGui::SetNextWindowBgAlpha(0.88F);
  ImGui::PushStyleColor(ImGuiCol_Border, colourOf(kSkyBlue));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 2);
  if (ImGui::Begin("##messages", nullptr, kLaidOver | ImGuiWindowFlags_NoInputs)) {
    const std::size_t shown = fresh ? kMessagesShown : 1;
    const std::size_t first = state.messages.size() - std::min(state.messages.size(), shown);
    for (std::size_t i = first; i < state.messages.size(); ++i) {
      const BoardMessage& message = state.messages[i];
      if (fresh) {
        const WithTextColour colour(kSkyBlue);
        textLine(message.from + ", " + localTime(message.unix_ns, TimeForm::kClock));
      }
      const WithFont heading(Letters::kHeading);
      const bool newest = i + 1 == state.messages.size();
      const WithTextColour colour(fresh && newest ? kText : kDimText);
      if (fresh && newest)
        textBlock(message.text);
      else
        textLine(fresh ? message.text : message.from + ": " + message.text);
    }
    if (state.next) {
      const WithTextColour colour(kSkyBlue);
      textLine("Next: " + exerciseName(state.lists, state.next->exercise) + " (" + state.next->from + ")");
    }
  }
  ImGui::End();
  ImGui::PopStyleVar();
  ImGui::PopStyleColor();
}

}  // namespace needlelab
