#include "client/view/surface.h"

#include <epoxy/gl.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <vector>

#include <imgui/backends/imgui_impl_glfw.h>
#include <imgui/backends/imgui_impl_opengl3.h>
#include <imgui/imgui.h>
#include <imgui/imgui_internal.h>

#include "client/view/gl_context.h"
#include "client/view/gl_objects.h"
#include "client/view/input_queue.h"
#include "client/view/theme.h"
#include "common/base/time/clock.h"

#if defined(__SANITIZE_ADDRESS__)
namespace {
std::atomic<bool> a_surface_was_opened{false};
}
// Driver threads live until the process ends. LeakSanitizer sometimes crashes when it scans them ("Tracer
// caught signal 11"), and it would report memory that drivers keep. So a process that drew skips the leak
// check.
extern "C" int __lsan_is_turned_off();
extern "C" int __lsan_is_turned_off() {
  return a_surface_was_opened ? 1 : 0;
}
#endif

namespace needlelab {
namespace {

constexpr double kUsualFrames_per_s = 30;
constexpr int kMaxRepeats = 15;

/// Sizes for a desk at this scale, for any size of the window; or for the screen's `viewing`.
LetterSizes wantedLetters(const std::optional<Viewing>& viewing, int width_px, int height_px, double scale) {
  if (viewing) return letterSizes(*viewing, width_px, height_px, scale);
  const LetterSizes desk;
  return {desk.body_px * scale, desk.small_px * scale, desk.heading_px * scale, desk.figure_px * scale};
}

double heldScale(double scale) {
  return std::clamp(std::isfinite(scale) ? scale : 1.0, 0.8, 2.5);
}

bool hasDisplay() {
  const char* display = std::getenv("DISPLAY");
  return display != nullptr && *display != '\0';
}

}  // namespace

struct Surface::Parts {
  SurfaceOptions options;
  std::unique_ptr<GlContext> context;
  std::unique_ptr<FrameBuffer> buffer;  // off screen: the target of drawing
  InputQueue input;
  ImVec2 mouse_px{-FLT_MAX, -FLT_MAX};  // in this frame
  std::array<bool, 5> buttons{};
  bool imgui = false;
  bool closed = false, close_wished = false;
  double wanted_scale = 1;
  std::optional<LetterSizes> letters;  // as loaded
  std::int64_t due_ns = 0, began_ns = 0;
  double cost_s = 0;
  std::uint64_t drawn_hash = 0;  // of the shown frame
  std::uint64_t frames_drawn = 0;
  int repeats = 0;                  // identical frames since then
  int width_px = 0, height_px = 0;  // of the picture

  ~Parts();
  void start();
  void waitForTurn();
  void takeSize();
  void applyLetters();
  void giveInput();
  void give(const InputEvent& event);
  void showFrame();
  // input from before the click comes first
  void takeCloseButton() {
    GLFWwindow* const window = context->window();
    if (window == nullptr || glfwWindowShouldClose(window) == 0 || !input.empty()) return;
    if (!options.asks_before_closing) {
      closed = true;
      return;
    }
    close_wished = true;
    glfwSetWindowShouldClose(window, GLFW_FALSE);
  }
};

Surface::Parts::~Parts() {
  buffer.reset();
  if (!imgui) return;
  ImGui_ImplOpenGL3_Shutdown();
  if (context->window() != nullptr) ImGui_ImplGlfw_Shutdown();
  ImGui::DestroyContext();
}

Surface::Surface(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

Surface::~Surface() {
  GLFWwindow* window = parts_->context->window();
  if (window == nullptr || parts_->options.state_file.empty()) return;
  WindowState state = readWindowState(parts_->options.state_file).value_or(WindowState());
  if (!parts_->options.full_screen) {
    glfwGetWindowPos(window, &state.x_px, &state.y_px);
    glfwGetWindowSize(window, &state.width_px, &state.height_px);
  }
  state.font_scale = parts_->wanted_scale;
  // failing to save the window's position must not make the lesson fail at its end
  (void)writeWindowState(parts_->options.state_file, state).ok();
}

Result<std::unique_ptr<Surface>> Surface::open(const SurfaceOptions& options) {
#if defined(__SANITIZE_ADDRESS__)
  a_surface_was_opened = true;
#endif
  if (options.time != &machineTime() && options.kind != SurfaceOptions::Kind::kOffScreen)
    return Error{ErrorCode::kInvalidInput,
                 "SurfaceOptions.time is not the machine's: only a surface of kind kOffScreen can have it"};
  // one worker, because a view beside a haptic loop has at most one core of its own
  ::setenv("LP_NUM_THREADS", "1", /*overwrite=*/0);
  const bool window = options.kind == SurfaceOptions::Kind::kWindow ||
                      (options.kind == SurfaceOptions::Kind::kAny && hasDisplay());
  Result<std::unique_ptr<GlContext>> context = window ? makeWindowContext(options) : makeOffScreenContext();
  if (!context && options.kind == SurfaceOptions::Kind::kAny && window) context = makeOffScreenContext();
  if (!context) return context.error();
  auto parts = std::make_unique<Parts>();
  parts->options = options;
  parts->context = std::move(context).value();
  if (epoxy_gl_version() < 33) {
    return Error{ErrorCode::kUnavailable,
                 "the graphics driver has no OpenGL 3.3: install a newer one, or libgl1-mesa-dri"};
  }
  parts->start();
  return std::unique_ptr<Surface>(new Surface(std::move(parts)));
}

void Surface::Parts::start() {
  ImGui::CreateContext();
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;  // the layout is fixed, so nothing to save
  io.LogFilename = nullptr;
  io.ConfigFlags |= ImGuiConfigFlags_NavEnableKeyboard;
  io.ConfigWindowsMoveFromTitleBarOnly = true;
  io.UserData = &input;  // for dropInputBefore
  imgui = true;
  if (context->window() != nullptr) {
    ImGui_ImplGlfw_InitForOpenGL(context->window(), /*install_callbacks=*/true);
    queueInput(context->window(), input);
  } else {
    buffer = std::make_unique<FrameBuffer>();
    mapKeys(io);
    io.BackendFlags |= ImGuiBackendFlags_HasMouseCursors;
    io.ConfigInputTextCursorBlink = false;  // for reproducible pictures
  }
  ImGui_ImplOpenGL3_Init("#version 330 core");
  const std::optional<WindowState> before =
      context->window() != nullptr ? readWindowState(options.state_file) : std::nullopt;
  wanted_scale = heldScale(before ? before->font_scale : options.font_scale);
  takeSize();
}

void Surface::Parts::takeSize() {
  width_px = std::clamp(options.width_px, 64, 16384);
  height_px = std::clamp(options.height_px, 64, 16384);
  if (context->window() != nullptr) glfwGetFramebufferSize(context->window(), &width_px, &height_px);
}

void Surface::Parts::applyLetters() {
  const LetterSizes wanted = wantedLetters(options.viewing, width_px, height_px, wanted_scale);
  if (letters == wanted) return;
  const bool first = !letters;
  letters = wanted;
  loadFonts(wanted);
  applyTheme(wanted);
  if (first) return;
  noteTextureChange();
  ImGui_ImplOpenGL3_DestroyFontsTexture();
  ImGui_ImplOpenGL3_CreateFontsTexture();
}

// Sleeps until the next frame is due. Handles a window's input early, but draws only when the frame is due.
void Surface::Parts::waitForTurn() {
  if (context->window() != nullptr) glfwPollEvents();
  if (!(options.frames_per_s > 0)) return;
  const auto period_ns = static_cast<std::int64_t>(1e9 / options.frames_per_s);
  std::int64_t now_ns = options.time->nowNs();
  while (now_ns < due_ns) {
    if (context->window() != nullptr)
      glfwWaitEventsTimeout(static_cast<double>(due_ns - now_ns) * 1e-9);
    else
      options.time->sleepUntilNs(due_ns);
    now_ns = options.time->nowNs();
  }
  // after a late frame, do not rush the next ones
  due_ns += period_ns;
  if (due_ns <= now_ns) due_ns = now_ns + period_ns;
}

void Surface::Parts::give(const InputEvent& event) {
  ImGuiIO& io = ImGui::GetIO();
  const auto code = static_cast<std::size_t>(event.code);  // GLFW uses -1 for unknown keys
  switch (event.kind) {
    case InputEvent::Kind::kKey:
      if (code < std::size(io.KeysDown)) io.KeysDown[code] = event.down;
      io.KeyCtrl = io.KeysDown[GLFW_KEY_LEFT_CONTROL] || io.KeysDown[GLFW_KEY_RIGHT_CONTROL];
      io.KeyShift = io.KeysDown[GLFW_KEY_LEFT_SHIFT] || io.KeysDown[GLFW_KEY_RIGHT_SHIFT];
      io.KeyAlt = io.KeysDown[GLFW_KEY_LEFT_ALT] || io.KeysDown[GLFW_KEY_RIGHT_ALT];
      io.KeySuper = io.KeysDown[GLFW_KEY_LEFT_SUPER] || io.KeysDown[GLFW_KEY_RIGHT_SUPER];
      return;
    case InputEvent::Kind::kCharacter:
      return io.AddInputCharacter(static_cast<unsigned>(event.code));
    case InputEvent::Kind::kButton:
      if (code < buttons.size()) buttons[code] = event.down;
      return;
    case InputEvent::Kind::kMove:
      mouse_px = {event.x, event.y};
      return;
    case InputEvent::Kind::kWheel:
      io.MouseWheelH += event.x;
      io.MouseWheel += event.y;
      return;
  }
}

// After the backend, which reads the mouse's present state instead of its state when a button was pressed.
void Surface::Parts::giveInput() {
  ImGuiIO& io = ImGui::GetIO();
  const std::vector<InputEvent> events = input.take();
  if (context->window() != nullptr && events.empty() && input.empty()) mouse_px = io.MousePos;
  for (const InputEvent& event : events) give(event);
  io.MousePos = mouse_px;
  std::copy(buttons.begin(), buttons.end(), io.MouseDown);
}

bool Surface::beginFrame() {
  Parts& parts = *parts_;
  GLFWwindow* window = parts.context->window();
  parts.takeCloseButton();
  if (parts.closed) return false;
  parts.waitForTurn();
  parts.takeCloseButton();
  if (parts.closed) return false;
  parts.began_ns = steadyNowNs();
  parts.takeSize();
  parts.applyLetters();
  ImGui_ImplOpenGL3_NewFrame();
  if (window != nullptr) {
    ImGui_ImplGlfw_NewFrame();
  } else {
    ImGuiIO& io = ImGui::GetIO();
    io.DisplaySize = {static_cast<float>(parts.width_px), static_cast<float>(parts.height_px)};
    const double rate = parts.options.frames_per_s > 0 ? parts.options.frames_per_s : kUsualFrames_per_s;
    io.DeltaTime = static_cast<float>(1 / rate);
  }
  parts.giveInput();
  ImGui::NewFrame();
  return true;
}

void Surface::endFrame() {
  Parts& parts = *parts_;
  ImGui::Render();
  parts.showFrame();
  // input until now came while the user saw the previous frame
  if (parts.context->window() != nullptr) glfwPollEvents();
  parts.input.shown(ImGui::GetFrameCount());
}

void Surface::Parts::showFrame() {
  // This frame is already shown; redraw it occasionally for a display that lost it.
  const std::uint64_t hash = hashOfFrame(*ImGui::GetDrawData(), width_px, height_px);
  const bool same = hash == drawn_hash && ++repeats < kMaxRepeats;
  if (same) {
    cost_s = static_cast<double>(steadyNowNs() - began_ns) * 1e-9;
    return;
  }
  drawn_hash = hash;
  repeats = 0;
  ++frames_drawn;
  if (buffer)
    buffer->bind(width_px, height_px);
  else
    glViewport(0, 0, width_px, height_px);
  glClearColor(kWindowGrey.red, kWindowGrey.green, kWindowGrey.blue, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  if (buffer) {
    buffer->resolve();
    glFinish();
  }
  cost_s = static_cast<double>(steadyNowNs() - began_ns) * 1e-9;
  context->swap();
}

RgbaImage Surface::picture() const {
  if (parts_->buffer) return parts_->buffer->read();
  // A window's buffer is invalid after the swap, but the frame's lists still exist: draw them again.
  ImDrawData* data = ImGui::GetDrawData();
  if (data == nullptr || !data->Valid) return {};
  FrameBuffer copy;
  copy.bind(parts_->width_px, parts_->height_px);
  glClearColor(kWindowGrey.red, kWindowGrey.green, kWindowGrey.blue, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  ImGui_ImplOpenGL3_RenderDrawData(data);
  copy.resolve();
  return copy.read();
}

void Surface::close() {
  parts_->closed = true;
}
bool Surface::takeCloseRequest() {
  return std::exchange(parts_->close_wished, false);
}
bool Surface::isWindow() const {
  return parts_->context->window() != nullptr;
}
int Surface::width_px() const {
  return parts_->width_px;
}
int Surface::height_px() const {
  return parts_->height_px;
}
double Surface::time_s() const {
  return ImGui::GetTime();
}
double Surface::frameCost_s() const {
  return parts_->cost_s;
}
std::uint64_t Surface::framesDrawn() const {
  return parts_->frames_drawn;
}
double Surface::fontScale() const {
  return parts_->wanted_scale;
}
void Surface::setFontScale(double scale) {
  parts_->wanted_scale = heldScale(scale);
}

void Surface::moveMouse(double x_px, double y_px) {
  parts_->input.add(
      {.kind = InputEvent::Kind::kMove, .x = static_cast<float>(x_px), .y = static_cast<float>(y_px)});
}
void Surface::setMouseButton(int button, bool down) {
  parts_->input.add({.kind = InputEvent::Kind::kButton, .code = button, .down = down});
}
void Surface::scroll(double steps) {
  parts_->input.add({.kind = InputEvent::Kind::kWheel, .y = static_cast<float>(steps)});
}
void Surface::setKey(int glfw_key, bool down) {
  parts_->input.add({.kind = InputEvent::Kind::kKey, .code = glfw_key, .down = down});
}
void Surface::typeText(const std::string& utf8) {
  const char* at = utf8.data();
  const char* const end = at + utf8.size();
  while (at < end) {
    unsigned character = 0;
    at += ImTextCharFromUtf8(&character, at, end);
    parts_->input.add({.kind = InputEvent::Kind::kCharacter, .code = static_cast<int>(character)});
  }
}

}  // namespace needlelab
