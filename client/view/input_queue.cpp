#include "client/view/input_queue.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include <imgui/imgui.h>

namespace needlelab {
namespace {

using Kind = InputEvent::Kind;

/// Whether the event can answer something. Releases and moves only end or point.
bool isPress(const InputEvent& event) {
  return event.kind == Kind::kCharacter ||
         (event.down && (event.kind == Kind::kKey || event.kind == Kind::kButton));
}

/// Whether a frame that saw `before` may also see `next`. A click takes the focus from a text field, so text
/// typed before it gets an earlier frame.
bool fitOneFrame(const InputEvent& before, const InputEvent& next) {
  if (before.kind == Kind::kButton) return false;
  if (next.kind == Kind::kButton) return !isPress(before);
  if (before.kind != Kind::kKey || next.kind != Kind::kKey) return true;
  return before.code != next.code && !(before.down && next.down);
}

}  // namespace

std::vector<InputEvent> InputQueue::take() {
  std::vector<InputEvent> seen;
  if (std::exchange(pauses_, false)) return seen;
  for (; !waiting_.empty(); waiting_.pop_front()) {
    const Waiting& next = waiting_.front();
    if (isPress(next.event) && next.saw < dropped_before_) continue;
    const auto has_room = [&](const InputEvent& before) { return fitOneFrame(before, next.event); };
    if (!std::all_of(seen.begin(), seen.end(), has_room)) break;
    seen.push_back(next.event);
  }
  return seen;
}

int keyMeant(int place, const char* label) {
  if (place >= GLFW_KEY_0 && place <= GLFW_KEY_9) return place;
  if (label == nullptr || label[0] == '\0' || label[1] != '\0') return place;
  const char sign = label[0];
  if (sign >= 'a' && sign <= 'z') return GLFW_KEY_A + (sign - 'a');
  if (sign >= 'A' && sign <= 'Z') return GLFW_KEY_A + (sign - 'A');
  if (sign == '+') return GLFW_KEY_EQUAL;
  // GLFW numbers these keys as ASCII
  return std::string_view("',-./;=[\\]`").find(sign) != std::string_view::npos ? sign : place;
}

namespace {

InputQueue& queueNow() {
  return *static_cast<InputQueue*>(ImGui::GetIO().UserData);
}

}  // namespace

void dropInputBefore(int frame) {
  queueNow().dropBefore(frame);
}

void focusNextField() {
  ImGui::SetKeyboardFocusHere();
  queueNow().pause();
}

void mapKeys(ImGuiIO& io) {
  io.KeyMap[ImGuiKey_Tab] = GLFW_KEY_TAB;
  io.KeyMap[ImGuiKey_LeftArrow] = GLFW_KEY_LEFT;
  io.KeyMap[ImGuiKey_RightArrow] = GLFW_KEY_RIGHT;
  io.KeyMap[ImGuiKey_UpArrow] = GLFW_KEY_UP;
  io.KeyMap[ImGuiKey_DownArrow] = GLFW_KEY_DOWN;
  io.KeyMap[ImGuiKey_PageUp] = GLFW_KEY_PAGE_UP;
  io.KeyMap[ImGuiKey_PageDown] = GLFW_KEY_PAGE_DOWN;
  io.KeyMap[ImGuiKey_Home] = GLFW_KEY_HOME;
  io.KeyMap[ImGuiKey_End] = GLFW_KEY_END;
  io.KeyMap[ImGuiKey_Insert] = GLFW_KEY_INSERT;
  io.KeyMap[ImGuiKey_Delete] = GLFW_KEY_DELETE;
  io.KeyMap[ImGuiKey_Backspace] = GLFW_KEY_BACKSPACE;
  io.KeyMap[ImGuiKey_Space] = GLFW_KEY_SPACE;
  io.KeyMap[ImGuiKey_Enter] = GLFW_KEY_ENTER;
  io.KeyMap[ImGuiKey_Escape] = GLFW_KEY_ESCAPE;
  io.KeyMap[ImGuiKey_KeyPadEnter] = GLFW_KEY_KP_ENTER;
  io.KeyMap[ImGuiKey_A] = GLFW_KEY_A;
  io.KeyMap[ImGuiKey_C] = GLFW_KEY_C;
  io.KeyMap[ImGuiKey_V] = GLFW_KEY_V;
  io.KeyMap[ImGuiKey_X] = GLFW_KEY_X;
  io.KeyMap[ImGuiKey_Y] = GLFW_KEY_Y;
  io.KeyMap[ImGuiKey_Z] = GLFW_KEY_Z;
}

void queueInput(GLFWwindow* window, InputQueue& input) {
  using Done = InputEvent::Kind;
  static constexpr auto kQueueOf = [](GLFWwindow* of) -> InputQueue& {
    return *static_cast<InputQueue*>(glfwGetWindowUserPointer(of));
  };
  glfwSetWindowUserPointer(window, &input);
  glfwSetKeyCallback(window, [](GLFWwindow* of, int place, int scancode, int action, int) {
    if (action == GLFW_REPEAT) return;  // Dear ImGui makes its own repeats
    // the keypad keeps its places: its labels are those of other keys
    const bool has_label = place >= GLFW_KEY_SPACE && place <= GLFW_KEY_GRAVE_ACCENT;
    const int key = has_label ? keyMeant(place, glfwGetKeyName(place, scancode)) : place;
    kQueueOf(of).add({.kind = Done::kKey, .code = key, .down = action == GLFW_PRESS});
  });
  glfwSetCharCallback(window, [](GLFWwindow* of, unsigned character) {
    kQueueOf(of).add({.kind = Done::kCharacter, .code = static_cast<int>(character)});
  });
  glfwSetMouseButtonCallback(window, [](GLFWwindow* of, int button, int action, int) {
    kQueueOf(of).add({.kind = Done::kButton, .code = button, .down = action == GLFW_PRESS});
  });
  glfwSetCursorPosCallback(window, [](GLFWwindow* of, double x_px, double y_px) {
    kQueueOf(of).add({.kind = Done::kMove, .x = static_cast<float>(x_px), .y = static_cast<float>(y_px)});
  });
  glfwSetScrollCallback(window, [](GLFWwindow* of, double right, double up) {
    kQueueOf(of).add({.kind = Done::kWheel, .x = static_cast<float>(right), .y = static_cast<float>(up)});
  });
}

}  // namespace needlelab
