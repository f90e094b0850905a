#include <epoxy/gl.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include "client/view/gl_context.h"
#include "client/view/window_state.h"

namespace needlelab {
namespace {

std::string glfwWords() {
  const char* words = nullptr;
  glfwGetError(&words);
  return words != nullptr ? words : "no reason given";
}

class WindowContext final : public GlContext {
 public:
  explicit WindowContext(GLFWwindow* window) : window_(window) {
    glfwMakeContextCurrent(window_);
    // where a display has a beat, its beat; llvmpipe has none, and the surface paces itself
    glfwSwapInterval(1);
  }
  ~WindowContext() override {
    glfwDestroyWindow(window_);
    // the library stays until the process ends: a driver that was unloaded could not be named by who looks
    // for leaks
  }
  WindowContext(const WindowContext&) = delete;
  WindowContext& operator=(const WindowContext&) = delete;
  [[nodiscard]] GLFWwindow* window() const override { return window_; }
  void swap() override { glfwSwapBuffers(window_); }

 private:
  GLFWwindow* window_;
};

// a place on a monitor that is no longer there would be out of reach
bool isOnSomeMonitor(const WindowState& state) {
  int count = 0;
  GLFWmonitor** monitors = glfwGetMonitors(&count);
  for (int i = 0; i < count; ++i) {
    int x = 0, y = 0, width = 0, height = 0;
    glfwGetMonitorWorkarea(monitors[i], &x, &y, &width, &height);
    constexpr int kSeen_px = 60;
    if (state.x_px + kSeen_px > x && state.x_px + kSeen_px < x + width && state.y_px >= y - kSeen_px &&
        state.y_px + kSeen_px < y + height)
      return true;
  }
  return false;
}

}  // namespace

Result<std::unique_ptr<GlContext>> makeWindowContext(const SurfaceOptions& options) {
  glfwSetErrorCallback(nullptr);
  if (glfwInit() != GLFW_TRUE) {
    return Error{ErrorCode::kUnavailable, "no window can be opened (" + glfwWords() +
                                              "): start it on a desktop, set DISPLAY, or use --headless"};
  }
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
  const std::optional<WindowState> before = readWindowState(options.state_file);
  const int width_px = before ? before->width_px : options.width_px;
  const int height_px = before ? before->height_px : options.height_px;
  GLFWwindow* window = glfwCreateWindow(width_px, height_px, options.title.c_str(), nullptr, nullptr);
  if (window == nullptr) {
    const std::string words = glfwWords();
    glfwTerminate();
    return Error{ErrorCode::kUnavailable, "no window with OpenGL 3.3 can be opened (" + words +
                                              "): install a driver or libgl1-mesa-dri"};
  }
  if (before && isOnSomeMonitor(*before)) glfwSetWindowPos(window, before->x_px, before->y_px);
  glfwSetWindowSizeLimits(window, 640, 400, GLFW_DONT_CARE, GLFW_DONT_CARE);
  glfwShowWindow(window);
  return std::unique_ptr<GlContext>(std::make_unique<WindowContext>(window));
}

}  // namespace needlelab
