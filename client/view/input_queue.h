#pragma once

#include <cstdint>
#include <deque>
#include <vector>

struct GLFWwindow;
struct ImGuiIO;

namespace needlelab {

/// One action with keyboard or mouse.
struct InputEvent {
  enum class Kind : std::uint8_t { kKey, kCharacter, kButton, kMove, kWheel };
  Kind kind = Kind::kKey;
  int code = 0;       ///< kKey: GLFW's number; kCharacter: the code point; kButton: 0 left, 1 right, 2 middle
  bool down = false;  ///< kKey, kButton
  float x = 0, y = 0;  ///< kMove: px to the right and down; kWheel: notches
};

/// Passes a surface's input to its frames in order. A frame sees at most one key press (with the text it
/// types), or one button press or release, and never both press and release of a key; input after a button
/// event waits for the next frame. So a slow frame loses no quick tap or click (Dear ImGui 1.86 only sees
/// what is down when a frame begins), and each event sees the effect of the previous one: a message is sent
/// before the click after it counts.
class InputQueue {
 public:
  void add(const InputEvent& event) { waiting_.push_back({event, shown_}); }
  [[nodiscard]] bool empty() const { return waiting_.empty(); }
  /// Returns the next frame's input, oldest first; the rest waits for later frames.
  std::vector<InputEvent> take();
  /// The user sees this frame from now on. Frame numbers ascend (ImGui::GetFrameCount).
  void shown(int frame) { shown_ = frame; }
  /// Drops presses and text from before the user saw this frame, including those still in the queue.
  void dropBefore(int frame) { dropped_before_ = frame; }
  /// The next frame gets no input; all of it waits for the one after.
  void pause() { pauses_ = true; }

 private:
  struct Waiting {
    InputEvent event;
    int saw;  // the frame that the user saw at that time
  };
  std::deque<Waiting> waiting_;
  int shown_ = 0, dropped_before_ = 0;
  bool pauses_ = false;
};

/// The key that a person means, by GLFW's numbers, which are places on a US keyboard: a letter, a sign, + and
/// - by its label in this computer's layout, a digit by its place (a French keyboard has & on the 1).
/// `label`: glfwGetKeyName's, UTF-8; null or of another script: the place.
int keyMeant(int place, const char* label);

// --- of the surface

/// Queues the window's input; `input` must outlive the window. The backend's own callbacks do not keep the
/// order.
void queueInput(GLFWwindow* window, InputQueue& input);
/// Off screen: keys by GLFW's numbers, as in ImGui's GLFW backend, so that the same shortcuts work.
void mapKeys(ImGuiIO& io);

// --- of the surface that is drawing now

/// `InputQueue::dropBefore`.
void dropInputBefore(int frame);
/// Focuses the field that is drawn next. Dear ImGui does so in the next frame, and the field accepts text
/// from the one after it; typed text waits until then.
void focusNextField();

}  // namespace needlelab
