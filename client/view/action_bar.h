/// Draws a screen's table of actions as buttons and hints, and takes its keys.
#pragma once

#include <optional>
#include <span>

#include "client/view/model/screen_actions.h"

namespace needlelab {

/// The action whose key was pressed in this frame, if any.
std::optional<int> actionByKey(std::span<const ScreenAction> actions);
/// Big buttons in a row, or, with a width (−1: the rest), below each other. `keys_named`: in the labels.
/// Returns the button that was pressed.
std::optional<int> actionButtons(std::span<const ScreenAction> actions, float width_px = 0,
                                 bool keys_named = false);
/// The same as buttons of the usual size, in the line of a form.
std::optional<int> actionLine(std::span<const ScreenAction> actions, bool keys_named = false);
/// The keys with their hints, in a row.
void actionHints(std::span<const ScreenAction> actions);
/// A question over the screen, opened by ImGui::OpenPopup(title) in an earlier frame: the answer by button or
/// key. `open` becomes false when it is not open.
std::optional<int> actionQuestion(const char* title, const char* text, std::span<const ScreenAction> actions,
                                  bool& open);

}  // namespace needlelab
