/// The actions of a screen: one table per screen, from which its buttons, keys and footer hints come. Enter
/// is the default, so the highlighted button and the key always agree. A question's default changes nothing.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace needlelab {

enum class ActionKey : std::uint8_t {
  kNone,
  kEnter,
  kEscape,
  kO,
  kDelete,         ///< confirms a question
  kEnterOrEscape,  ///< changes nothing: a question's default
};

struct ScreenAction {
  int id = 0;         ///< chosen by the screen
  std::string label;  ///< of the button
  ActionKey key = ActionKey::kNone;
  std::string hint;  ///< at the screen's foot, beside the key; empty: none
  bool enabled = true;
  /// Highlighted as the most likely choice; at most one per table.
  [[nodiscard]] bool isDefault() const {
    return key == ActionKey::kEnter || key == ActionKey::kEnterOrEscape;
  }
};

/// "Enter", "Esc", "Enter, Esc"; empty without a key.
std::string_view keyWord(ActionKey key);
/// "End it (Del)": for questions, which have no hints.
std::string labelWithKey(const ScreenAction& action);
/// Returns the id of the key's action; nullopt if there is none or it is disabled.
std::optional<int> actionOf(std::span<const ScreenAction> actions, ActionKey key);

}  // namespace needlelab
