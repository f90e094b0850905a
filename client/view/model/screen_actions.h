/// What a person can do on a screen: one table a screen. Its buttons, its keys and the hints at its foot come
/// from it. Enter is the default, so that the highlighted button and the key cannot differ. A question's
/// default leaves everything as it is.
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
  kDelete,         ///< does what a question asks
  kEnterOrEscape,  ///< leaves everything as it is: a question's default
};

struct ScreenAction {
  int id = 0;         ///< the screen's own number
  std::string label;  ///< the button's
  ActionKey key = ActionKey::kNone;
  std::string hint;  ///< at the screen's foot, beside the key; empty: none
  bool enabled = true;
  /// Drawn as the most likely choice; at most one of a table.
  [[nodiscard]] bool isDefault() const {
    return key == ActionKey::kEnter || key == ActionKey::kEnterOrEscape;
  }
};

/// "Enter", "Esc", "Enter, Esc"; empty without a key.
std::string_view keyWord(ActionKey key);
/// "End it (Del)": for questions, which have no hints.
std::string labelWithKey(const ScreenAction& action);
/// The id of the action that the key means; none if there is none or it is not possible now.
std::optional<int> actionOf(std::span<const ScreenAction> actions, ActionKey key);

}  // namespace needlelab
