// What is laid over the picture of a lesson: faults and holds, and what instructors say.
#include <algorithm>
#include <ctime>
#include <string>

#include "client/station/window/keys.h"
#include "client/station/window/lesson_screen.h"
#include "client/station/window/overlay_words.h"
#include "client/view/model/palette.h"
#include "client/view/theme.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr std::size_t kMessagesShown = 3;
constexpr double kFresh_s = 20;
constexpr ImGuiWindowFlags kLaidOver = ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove |
                                       ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoSavedSettings |
                                       ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoFocusOnAppearing;

// "14:05:09" of the wall clock here
std::string clockOf(std::int64_t unix_ns) {
  const std::time_t seconds = static_cast<std::time_t>(unix_ns / 1'000'000'000);
  std::tm local{};
  ::localtime_r(&seconds, &local);
  return formatted("%02d:%02d:%02d", local.tm_hour, local.tm_min, local.tm_sec);
}

}  // namespace

void lessonOverlay(const LessonStanding& standing, LessonRequests& requests, ImVec2 corner_px,
                   ImVec2 size_px) {
  const Overlay overlay = overlayOf(standing);
  if (overlay.kind == Overlay::Kind::kNone) return;
  const bool fault = overlay.kind == Overlay::Kind::kFault;
  const bool enter = enterPressed();
  if (fault && enter) requests.acknowledge();

  const Condition condition = fault ? Condition::kTrouble : Condition::kAttention;
  const float width = std::min(0.86F * size_px.x, 62 * space());
  ImGui::SetNextWindowPos({corner_px.x + 0.5F * size_px.x, corner_px.y + (fault ? 0.3F : 0.14F) * size_px.y},
                          ImGuiCond_Always, {0.5F, 0.5F});
  ImGui::SetNextWindowSize({width, 0});
  ImGui::SetNextWindowBgAlpha(0.94F);
  ImGui::PushStyleColor(ImGuiCol_Border, colourOf(styleOf(condition).colour));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 3);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {2 * space(), 1.5F * space()});
  if (ImGui::Begin("##overlay", nullptr, kLaidOver)) {
    {
      const WithFont heading(Letters::kHeading);
      conditionLine(condition, overlay.title);
    }
    textBlock(overlay.what);
    ImGui::Spacing();
    textBlock(overlay.todo);
    if (overlay.can_acknowledge) {
      ImGui::Spacing();
      if (bigButton("I have seen it (Enter)", true)) requests.acknowledge();
    }
  }
  ImGui::End();
  ImGui::PopStyleVar(2);
  ImGui::PopStyleColor();
}

void lessonMessages(const BoardState& state, ImVec2 corner_px, ImVec2 size_px) {
  if (state.messages.empty() && !state.next) return;
  ImGui::SetNextWindowPos({corner_px.x + space(), corner_px.y + size_px.y - space()}, ImGuiCond_Always,
                          {0, 1});
  ImGui::SetNextWindowSize({0.62F * size_px.x, 0});
  ImGui::SetNextWindowBgAlpha(0.88F);
  ImGui::PushStyleColor(ImGuiCol_Border, colourOf(kSkyBlue));
  ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 2);
  if (ImGui::Begin("##messages", nullptr, kLaidOver | ImGuiWindowFlags_NoInputs)) {
    // what was said a while ago is one line, so that it hides nothing
    const bool fresh =
        !state.messages.empty() && state.messages.back().lesson_s + kFresh_s > state.standing.time_s;
    const std::size_t shown = fresh ? kMessagesShown : 1;
    const std::size_t first = state.messages.size() - std::min(state.messages.size(), shown);
    for (std::size_t i = first; i < state.messages.size(); ++i) {
      const BoardMessage& message = state.messages[i];
      if (!fresh) {
        const WithFont small(Letters::kSmall);
        textLine(message.from + ", " + clockOf(message.unix_ns) + ": " + message.text);
        continue;
      }
      {
        const WithFont small(Letters::kSmall);
        const WithTextColour colour(kSkyBlue);
        textLine(message.from + ", " + clockOf(message.unix_ns));
      }
      const bool newest = i + 1 == state.messages.size();
      const WithTextColour colour(newest ? kText : kDimText);
      textBlock(message.text);
    }
    if (state.next) {
      const WithFont small(Letters::kSmall);
      const WithTextColour colour(kSkyBlue);
      textLine(state.next->from + " wants next: " + state.next->exercise);
    }
  }
  ImGui::End();
  ImGui::PopStyleVar();
  ImGui::PopStyleColor();
}

}  // namespace needlelab
