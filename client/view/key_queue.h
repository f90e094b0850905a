#pragma once

#include <deque>
#include <vector>

namespace needlelab {

struct KeyEvent {
  int key = 0, scancode = 0, mods = 0;  ///< as GLFW gives them
  bool down = false;
};

/// Gives a window's key events to its frames in their order. A frame sees at most one key go down, and no key
/// both go down and up. So a frame that took long loses no quick tap (Dear ImGui 1.86 only sees which keys
/// are down when a frame begins), and the second of two keys meets what the first one opened.
class KeyQueue {
 public:
  void add(const KeyEvent& event) { waiting_.push_back(event); }
  /// Returns what the next frame sees, oldest first; the rest waits for later frames.
  std::vector<KeyEvent> take();

 private:
  std::deque<KeyEvent> waiting_;
};

}  // namespace needlelab
