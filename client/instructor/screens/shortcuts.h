/// Keys of the instructor's window.
#pragma once

namespace needlelab {

class InstructorWindow;

/// Acts on what was pressed in this frame; nothing while somebody types.
void actOnKeys(InstructorWindow& window);
/// The list of them over the screen.
void showShortcuts();

}  // namespace needlelab
