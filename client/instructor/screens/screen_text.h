/// What stands on the screen, as text: for scripts that wait for words or expect them.
#pragma once

#include <string>

namespace needlelab {

/// Everything that is written between construction and `take`, in the order of writing. One at a time, within
/// one ImGui window that opens no other (tooltips end it).
class ScreenText {
 public:
  ScreenText();
  ~ScreenText();
  ScreenText(const ScreenText&) = delete;
  ScreenText& operator=(const ScreenText&) = delete;
  std::string take();
};

/// Runs of spaces and line ends become one space.
std::string flatText(const std::string& text);

}  // namespace needlelab
