#include "client/view/action_bar.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <imgui/imgui.h>

#include <array>
#include <utility>

#include "client/view/input_queue.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

// GLFW's key numbers, as a surface reports them in a window and off screen
constexpr std::array kActionKeys = {
    std::pair(ActionKey::kEnter, GLFW_KEY_ENTER), std::pair(ActionKey::kEnter, GLFW_KEY_KP_ENTER),
    std::pair(ActionKey::kEscape, GLFW_KEY_ESCAPE), std::pair(ActionKey::kO, GLFW_KEY_O),
    std::pair(ActionKey::kDelete, GLFW_KEY_DELETE)};

}  // namespace

std::optional<int> actionByKey(std::span<const ScreenAction> actions) {
  for (const auto& [key, number] : kActionKeys)
    if (ImGui::IsKeyPressed(number, false))
      if (const auto id = actionOf(actions, key)) return id;
  return std::nullopt;
}

std::optional<int> actionButtons(std::span<const ScreenAction> actions, float width_px, bool keys_named) {
  std::optional<int> chosen;
  bool first = true;
  for (const ScreenAction& action : actions) {
    if (!std::exchange(first, false)) width_px == 0 ? ImGui::SameLine() : ImGui::Spacing();
    const std::string label = keys_named ? labelWithKey(action) : action.label;
    if (bigButton(label.c_str(), action.isDefault(), width_px, action.enabled)) chosen = action.id;
  }
  return chosen;
}

std::optional<int> actionLine(std::span<const ScreenAction> actions, bool keys_named) {
  std::optional<int> chosen;
  bool first = true;
  for (const ScreenAction& action : actions) {
    if (!std::exchange(first, false)) ImGui::SameLine();
    const std::string label = keys_named ? labelWithKey(action) : action.label;
    ImGui::BeginDisabled(!action.enabled);
    if (action.isDefault()) ImGui::PushStyleColor(ImGuiCol_Button, colourOf(kBlue));
    if (ImGui::Button(label.c_str())) chosen = action.id;
    if (action.isDefault()) ImGui::PopStyleColor();
    ImGui::EndDisabled();
  }
  return chosen;
}

void actionHints(std::span<const ScreenAction> actions) {
  bool first = true;
  for (const ScreenAction& action : actions) {
    if (action.hint.empty()) continue;
    if (!std::exchange(first, false)) ImGui::SameLine();
    keyHint(keyWord(action.key), action.hint);
  }
}

bool AnswerGate::opens(int asked, int hidden) {
  const int frame = ImGui::GetFrameCount();
  const bool appears = asked != asked_ || frame != frame_ + 1;
  asked_ = asked;
  frame_ = frame;
  if (asked == 0) return false;
  if (appears) dropInputBefore(frame + hidden);
  return !appears;
}

std::optional<int> Question::show(const char* text, std::span<const ScreenAction> actions) {
  if (std::exchange(opens_, false)) ImGui::OpenPopup(title_);
  const ImVec2 middle{0.5F * ImGui::GetIO().DisplaySize.x, 0.5F * ImGui::GetIO().DisplaySize.y};
  ImGui::SetNextWindowPos(middle, ImGuiCond_Always, {0.5F, 0.5F});
  asked_ =
      ImGui::BeginPopupModal(title_, nullptr, ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoMove);
  shown_ = gate_.opens(asked_ ? 1 : 0, /*hidden=*/1);
  if (!asked_) return std::nullopt;
  ImGui::TextUnformatted(text);
  ImGui::Spacing();
  ImGui::BeginDisabled(!shown_);
  auto chosen = actionButtons(actions, 0, true);
  ImGui::EndDisabled();
  if (shown_ && !chosen) chosen = actionByKey(actions);
  const bool withdrawn = std::exchange(withdrawn_, false);
  if (withdrawn) chosen.reset();
  if (chosen || withdrawn) {
    ImGui::CloseCurrentPopup();
    asked_ = shown_ = false;
  }
  ImGui::EndPopup();
  return chosen;
}

}  // namespace needlelab
