#include "client/view/surface.h"

#include <epoxy/gl.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <vector>

#include <imgui/backends/imgui_impl_glfw.h>
#include <imgui/backends/imgui_impl_opengl3.h>
#include <imgui/imgui.h>
#include <imgui/imgui_internal.h>
#include <stb/stb_image.h>
#include <stb/stb_image_write.h>

#include "client/view/gl_context.h"
#include "client/view/gl_objects.h"
#include "client/view/input_queue.h"
#include "client/view/theme.h"
#include "common/base/clock.h"
#include "common/base/files.h"

#if defined(__SANITIZE_ADDRESS__)
namespace {
std::atomic<bool> a_surface_was_opened{false};
}
// Driver threads live until the process ends, and LeakSanitizer sometimes crashes when it scans them ("Tracer
// caught signal 11"); it would also report memory that drivers keep. So skip the leak check in a process that
// drew.
extern "C" int __lsan_is_turned_off();
extern "C" int __lsan_is_turned_off() {
  return a_surface_was_opened ? 1 : 0;
}
#endif

namespace needlelab {
namespace {

constexpr double kUsualFrames_per_s = 30;
constexpr int kMostRepeats = 15;

/// A desk's letters at this scale, whatever the window's size; or as the screen's place asks.
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

// keys by GLFW's numbers, as in ImGui's GLFW backend, so that the same shortcuts work off screen
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

// what a person does at a window; the backend's own callbacks keep no order
void queueInput(GLFWwindow* window, InputQueue& input) {
  using Done = InputEvent::Kind;
  static constexpr auto kQueueOf = [](GLFWwindow* of) -> InputQueue& {
    return *static_cast<InputQueue*>(glfwGetWindowUserPointer(of));
  };
  glfwSetWindowUserPointer(window, &input);
  glfwSetKeyCallback(window, [](GLFWwindow* of, int key, int, int action, int) {
    if (action == GLFW_REPEAT) return;  // Dear ImGui repeats by itself
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

// FNV hash over 64-bit words of the frame's draw data
std::uint64_t hashOfBytes(const void* data, std::size_t size, std::uint64_t hash) {
  const auto* bytes = static_cast<const unsigned char*>(data);
  for (; size >= 8; size -= 8, bytes += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes, 8);
    hash = (hash ^ word) * 0x100000001B3u;
    hash ^= hash >> 29;
  }
  for (; size > 0; --size, ++bytes) hash = (hash ^ *bytes) * 0x100000001B3u;
  return hash;
}

std::uint64_t hashOfFrame(const ImDrawData& data, int width_px, int height_px) {
  std::uint64_t hash = (0xCBF29CE484222325u ^ takeContent()) * 0x100000001B3u ^ textureChanges();
  hash =
      (hash ^ static_cast<std::uint64_t>(width_px)) * 0x100000001B3u ^ static_cast<std::uint64_t>(height_px);
  for (int i = 0; i < data.CmdListsCount; ++i) {
    const ImDrawList& list = *data.CmdLists[i];
    hash = hashOfBytes(list.VtxBuffer.Data, static_cast<std::size_t>(list.VtxBuffer.size_in_bytes()), hash);
    hash = hashOfBytes(list.IdxBuffer.Data, static_cast<std::size_t>(list.IdxBuffer.size_in_bytes()), hash);
    for (const ImDrawCmd& command : list.CmdBuffer) {
      hash = hashOfBytes(&command.ClipRect, sizeof command.ClipRect, hash);
      hash = (hash ^ reinterpret_cast<std::uintptr_t>(command.TextureId)) * 0x100000001B3u;
    }
  }
  return hash;
}

}  // namespace

struct Surface::Parts {
  SurfaceOptions options;
  std::unique_ptr<GlContext> context;
  std::unique_ptr<FrameBuffer> buffer;  // off screen: the target of drawing
  InputQueue input;
  ImVec2 mouse_px{-FLT_MAX, -FLT_MAX};  // as this frame sees it
  std::array<bool, 5> buttons{};
  bool imgui = false;
  bool closed = false, close_wished = false;
  double wanted_scale = 1;
  std::optional<LetterSizes> letters;  // as loaded
  std::int64_t due_ns = 0, began_ns = 0;
  double cost_s = 0;
  std::uint64_t drawn_hash = 0;  // of the shown frame
  std::uint64_t frames_drawn = 0;
  int repeats = 0;                  // identical frames since
  int width_px = 0, height_px = 0;  // of the picture

  ~Parts();
  void start();
  void waitForTurn();
  void takeSize();
  void applyLetters();
  void giveInput();
  void give(const InputEvent& event);
  void showFrame();
  // what was done before it comes first
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
  // failing to write the window's position must not fail a lesson at its end
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

// sleeps until the next frame is due; handles a window's input early, but draws it when the frame is due
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
  // after a late frame, do not hurry the next ones
  due_ns += period_ns;
  if (due_ns <= now_ns) due_ns = now_ns + period_ns;
}

void Surface::Parts::give(const InputEvent& event) {
  ImGuiIO& io = ImGui::GetIO();
  const auto code = static_cast<std::size_t>(event.code);  // GLFW has -1 for a key that it does not know
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

// after the backend, which reads the mouse as it is by now, and not as it was when a button was pressed
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
  // what came until now came while the person saw the frame before
  if (parts.context->window() != nullptr) glfwPollEvents();
  parts.input.shown(ImGui::GetFrameCount());
}

void Surface::Parts::showFrame() {
  // the same frame is already shown; still draw it now and then, for a display that lost it
  const std::uint64_t hash = hashOfFrame(*ImGui::GetDrawData(), width_px, height_px);
  const bool same = hash == drawn_hash && ++repeats < kMostRepeats;
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
  // a window's buffer is invalid after the swap, but the frame's lists still exist: draw them again
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
bool Surface::takeCloseWish() {
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

Status savePng(const RgbaImage& image, const std::filesystem::path& file) {
  std::string png;
  const auto append = [](void* to, void* data, int size) {
    static_cast<std::string*>(to)->append(static_cast<const char*>(data), static_cast<std::size_t>(size));
  };
  const bool whole = image.width > 0 && image.height > 0 &&
                     image.pixels.size() ==
                         4 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  if (!whole ||
      stbi_write_png_to_func(append, &png, image.width, image.height, 4, image.pixels.data(), 0) == 0)
    return Error{ErrorCode::kFailed, file.string() + ": the picture cannot be coded as PNG"};
  return writeFileAtomically(file, viewOf(png));
}

Result<RgbaImage> loadPng(const std::filesystem::path& file) {
  constexpr std::size_t kMostBytes = 64u << 20;
  const Result<std::string> bytes = readWholeFile(file, kMostBytes);
  if (!bytes) return Error{ErrorCode::kNotFound, bytes.error().message};
  RgbaImage image;
  int channels = 0;
  stbi_uc* pixels =
      stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(bytes->data()), static_cast<int>(bytes->size()),
                            &image.width, &image.height, &channels, 4);
  if (pixels == nullptr) return Error{ErrorCode::kCorrupt, file.string() + ": no PNG that can be read"};
  image.pixels.assign(
      pixels, pixels + 4 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  stbi_image_free(pixels);
  return image;
}

}  // namespace needlelab
