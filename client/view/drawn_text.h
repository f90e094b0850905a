/// The words of a frame, recovered from the letters that were drawn: what a person can read, and no more:
/// letters cut off at a panel's edge do not count.
#pragma once

#include <string>
#include <vector>

#include "client/view/theme.h"

namespace needlelab {

/// Letters drawn one after the other on a line.
struct DrawnLine {
  Letters letters = Letters::kBody;  ///< of its first letter
  std::string text;                  ///< UTF-8, with its blanks
  bool scaled = false;               ///< a letter was drawn in a size other than its font's
};

/// Reads the last frame of the current ImGui context, in the order of drawing. Thread: the window's, after
/// the frame was drawn.
std::vector<DrawnLine> drawnText();

}  // namespace needlelab
