#include "client/view/gl_context.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <nlohmann/json.hpp>
#include <optional>

#include <fmt/core.h>

#include "common/base/files/files.h"

namespace needlelab {
namespace {

constexpr std::size_t kMaxStateBytes = 4096;

std::optional<double> numberIn(const nlohmann::json& object, const char* name, double least,
                               double greatest) {
  const auto found = object.find(name);
  if (found == object.end() || !found->is_number()) return std::nullopt;
  const double value = found->get<double>();
  if (!(value >= least && value <= greatest)) return std::nullopt;
  return value;
}

}  // namespace

std::optional<WindowState> readWindowState(const std::filesystem::path& file) {
  if (file.empty()) return std::nullopt;
  const Result<std::string> text = readWholeFile(file, kMaxStateBytes);
  if (!text) return std::nullopt;
  const auto json = nlohmann::json::parse(*text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return std::nullopt;
  const auto x = numberIn(json, "x_px", -32768, 32768), y = numberIn(json, "y_px", -32768, 32768);
  const auto width = numberIn(json, "width_px", 320, 16384), height = numberIn(json, "height_px", 320, 16384);
  const auto scale = numberIn(json, "font_scale", 0.8, 2.5);
  if (!x || !y || !width || !height || !scale) return std::nullopt;
  return WindowState{static_cast<int>(*x), static_cast<int>(*y), static_cast<int>(*width),
                     static_cast<int>(*height), *scale};
}

Status writeWindowState(const std::filesystem::path& file, const WindowState& state) {
  std::error_code ignored;  // the write below reports a missing folder
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), ignored);
  const std::string text = fmt::format(
      "{{\"x_px\": {}, \"y_px\": {}, \"width_px\": {}, \"height_px\": {}, \"font_scale\": {:.2f}}}\n",
      state.x_px, state.y_px, state.width_px, state.height_px, state.font_scale);
  return writeFileAtomically(file, viewOf(text));
}

namespace {

std::string glfwErrorText() {
  const char* words = nullptr;
  glfwGetError(&words);
  return words != nullptr ? words : "no reason given";
}

class WindowContext final : public GlContext {
 public:
  explicit WindowContext(GLFWwindow* window) : window_(window) {
    glfwMakeContextCurrent(window_);
    // Wait for the display's refresh. llvmpipe has none, so the surface paces itself.
    glfwSwapInterval(1);
  }
  ~WindowContext() override {
    glfwDestroyWindow(window_);
    // Keep the library loaded until the process ends: a leak report cannot name functions of an unloaded
    // driver.
  }
  WindowContext(const WindowContext&) = delete;
  WindowContext& operator=(const WindowContext&) = delete;
  [[nodiscard]] GLFWwindow* window() const override { return window_; }
  void swap() override { glfwSwapBuffers(window_); }

 private:
  GLFWwindow* window_;
};

// avoids a window on a disconnected monitor
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
    return Error{ErrorCode::kUnavailable, "no window can be opened (" + glfwErrorText() +
                                              "): start it on a desktop, set DISPLAY, or use --headless"};
  }
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
  GLFWmonitor* const monitor = options.full_screen ? glfwGetPrimaryMonitor() : nullptr;
  const std::optional<WindowState> before =
      monitor == nullptr ? readWindowState(options.state_file) : std::nullopt;
  int width_px = before ? before->width_px : options.width_px;
  int height_px = before ? before->height_px : options.height_px;
  if (monitor != nullptr) {
    // the monitor's own mode: keeps the resolution, and the window stays open when it loses the focus
    const GLFWvidmode* const mode = glfwGetVideoMode(monitor);
    width_px = mode->width, height_px = mode->height;
    glfwWindowHint(GLFW_RED_BITS, mode->redBits);
    glfwWindowHint(GLFW_GREEN_BITS, mode->greenBits);
    glfwWindowHint(GLFW_BLUE_BITS, mode->blueBits);
    glfwWindowHint(GLFW_REFRESH_RATE, mode->refreshRate);
    glfwWindowHint(GLFW_AUTO_ICONIFY, GLFW_FALSE);
  }
  GLFWwindow* window = glfwCreateWindow(width_px, height_px, options.title.c_str(), monitor, nullptr);
  if (window == nullptr) {
    const std::string words = glfwErrorText();
    glfwTerminate();
    return Error{ErrorCode::kUnavailable, "no window with OpenGL 3.3 can be opened (" + words +
                                              "): install a driver or libgl1-mesa-dri"};
  }
  if (before && isOnSomeMonitor(*before)) glfwSetWindowPos(window, before->x_px, before->y_px);
  if (monitor == nullptr) glfwSetWindowSizeLimits(window, 640, 400, GLFW_DONT_CARE, GLFW_DONT_CARE);
  glfwShowWindow(window);
  return std::unique_ptr<GlContext>(std::make_unique<WindowContext>(window));
}

namespace {

class OffScreenContext final : public GlContext {
 public:
  OffScreenContext(EGLDisplay display, EGLContext context) : display_(display), context_(context) {}
  ~OffScreenContext() override {
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    if (context_ != EGL_NO_CONTEXT) eglDestroyContext(display_, context_);
    // Keep the display: it belongs to the process, and a leak report cannot name functions of an unloaded
    // driver.
  }
  OffScreenContext(const OffScreenContext&) = delete;
  OffScreenContext& operator=(const OffScreenContext&) = delete;
  [[nodiscard]] GLFWwindow* window() const override { return nullptr; }
  void swap() override {}

 private:
  EGLDisplay display_;
  EGLContext context_;
};

Error refusal(const char* what) {
  return Error{
      ErrorCode::kUnavailable,
      fmt::format("no picture can be drawn without a display ({}, EGL error 0x{:x}): install libegl1 and "
                  "libgl1-mesa-dri",
                  what, static_cast<unsigned>(eglGetError()))};
}

}  // namespace

Result<std::unique_ptr<GlContext>> makeOffScreenContext() {
  const EGLDisplay display =
      eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
  if (display == EGL_NO_DISPLAY) return refusal("no surfaceless platform");
  EGLint major = 0, minor = 0;
  if (eglInitialize(display, &major, &minor) != EGL_TRUE) return refusal("eglInitialize");
  if (eglBindAPI(EGL_OPENGL_API) != EGL_TRUE) {
    eglTerminate(display);
    return refusal("no OpenGL");
  }
  constexpr EGLint kAttributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                                    3,
                                    EGL_CONTEXT_MINOR_VERSION,
                                    3,
                                    EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                    EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                    EGL_NONE};
  const EGLContext context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, kAttributes);
  auto made = std::make_unique<OffScreenContext>(display, context);
  if (context == EGL_NO_CONTEXT) return refusal("no OpenGL 3.3 core context");
  if (eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context) != EGL_TRUE)
    return refusal("eglMakeCurrent");
  return std::unique_ptr<GlContext>(std::move(made));
}

}  // namespace needlelab
