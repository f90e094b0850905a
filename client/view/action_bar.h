/// Draws a screen's table of actions as buttons and hints, and handles its keys.
#pragma once

#include <optional>
#include <span>

#include "client/view/model/screen_actions.h"

namespace needlelab {

/// Returns the action whose key was pressed in this frame, if any.
std::optional<int> actionByKey(std::span<const ScreenAction> actions);
/// Big buttons in a row, or stacked if a width is given (−1: the remaining width). `keys_named`: adds the key
/// to each label. Returns the pressed button.
std::optional<int> actionButtons(std::span<const ScreenAction> actions, float width_px = 0,
                                 bool keys_named = false);
/// Like actionButtons, with buttons of normal size in a form's line.
std::optional<int> actionLine(std::span<const ScreenAction> actions, bool keys_named = false);
/// Draws the keys with their hints in a row.
void actionHints(std::span<const ScreenAction> actions);
/// Keeps a question from being answered by keys and clicks from before the user saw it.
class AnswerGate {
 public:
  /// Call in every frame that can show the question. `asked`: the question, 0 if none; `hidden`: frames for
  /// which Dear ImGui measures it before drawing it. Returns whether it can be answered: from the second
  /// visible frame on, by input after a frame with the question was seen. Draw its buttons disabled until
  /// then.
  bool opens(int asked, int hidden = 0);

 private:
  int asked_ = 0, frame_ = 0;
};

/// A question over the screen.
class Question {
 public:
  explicit Question(const char* title) : title_(title) {}
  /// Drawn from the next `show` on.
  void ask() { opens_ = asked_ = true; }
  void ask(const char* title) { title_ = title, ask(); }
  /// Closes it without an answer.
  void withdraw() { withdrawn_ = asked_; }
  /// Returns whether the question is open.
  [[nodiscard]] bool asked() const { return asked_; }
  /// Returns whether the last frame showed the question, so that it can be answered.
  [[nodiscard]] bool shown() const { return shown_; }
  /// Call in every frame, in the same Dear ImGui window. Returns the answer by button or key.
  std::optional<int> show(const char* text, std::span<const ScreenAction> actions);

 private:
  const char* title_;
  bool opens_ = false, asked_ = false, shown_ = false, withdrawn_ = false;
  AnswerGate gate_;
};

}  // namespace needlelab
