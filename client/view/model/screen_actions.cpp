#include "client/view/model/screen_actions.h"

namespace needlelab {

std::string_view keyWord(ActionKey key) {
  switch (key) {
    case ActionKey::kEnter:
      return "Enter";
    case ActionKey::kEscape:
      return "Esc";
    case ActionKey::kO:
      return "O";
    case ActionKey::kDelete:
      return "Del";
    case ActionKey::kEnterOrEscape:
      return "Enter, Esc";
    case ActionKey::kNone:
      break;
  }
  return {};
}

std::string labelWithKey(const ScreenAction& action) {
  const std::string_view key = keyWord(action.key);
  return key.empty() ? action.label : action.label + " (" + std::string(key) + ")";
}

namespace {

bool isPressedBy(ActionKey of_action, ActionKey key) {
  if (of_action == ActionKey::kEnterOrEscape) return key == ActionKey::kEnter || key == ActionKey::kEscape;
  return of_action == key && key != ActionKey::kNone;
}

}  // namespace

std::optional<int> actionOf(std::span<const ScreenAction> actions, ActionKey key) {
  for (const ScreenAction& action : actions)
    if (isPressedBy(action.key, key) && action.enabled) return action.id;
  return std::nullopt;
}

}  // namespace needlelab
