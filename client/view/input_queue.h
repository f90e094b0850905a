#pragma once

#include <cstdint>
#include <deque>
#include <vector>

namespace needlelab {

/// One thing that a person does with keyboard or mouse.
struct InputEvent {
  enum class Kind : std::uint8_t { kKey, kCharacter, kButton, kMove, kWheel };
  Kind kind = Kind::kKey;
  int code = 0;       ///< kKey: GLFW's number; kCharacter: the code point; kButton: 0 left, 1 right, 2 middle
  bool down = false;  ///< kKey, kButton
  float x = 0, y = 0;  ///< kMove: px to the right and down; kWheel: notches
};

/// Gives a surface's input to its frames in its order. A frame sees at most one key go down, with the text
/// that it writes, or one button go down or up, and no key both go down and up; what follows a button waits
/// for the next frame. So a frame that took long loses no quick tap or click (Dear ImGui 1.86 only sees what
/// is down when a frame begins), and each of them meets what the one before it did: a message is sent before
/// the click after it counts.
class InputQueue {
 public:
  void add(const InputEvent& event) { waiting_.push_back({event, shown_}); }
  [[nodiscard]] bool empty() const { return waiting_.empty(); }
  /// Returns what the next frame sees, oldest first; the rest waits for later frames.
  std::vector<InputEvent> take();
  /// The person sees this frame from now on. Frames have ascending numbers (ImGui::GetFrameCount).
  void shown(int frame) { shown_ = frame; }
  /// Drops, now and later, the keys and buttons that went down and the text that was written before the
  /// person saw this frame.
  void dropBefore(int frame) { dropped_before_ = frame; }
  /// The next frame sees nothing; everything waits for the one after it.
  void pause() { pauses_ = true; }

 private:
  struct Waiting {
    InputEvent event;
    int saw;  // the frame that the person saw then
  };
  std::deque<Waiting> waiting_;
  int shown_ = 0, dropped_before_ = 0;
  bool pauses_ = false;
};

// --- of the surface that draws now

/// `InputQueue::dropBefore`.
void dropInputBefore(int frame);
/// Gives the keyboard to the field that is drawn next. Dear ImGui does so in the next frame, and the field
/// takes text from the one after it: what is typed waits until then.
void focusNextField();

}  // namespace needlelab
