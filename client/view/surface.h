/// A surface to draw on: a window (GLFW), or an off-screen picture (surfaceless EGL); the same frame loop for
/// both.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "client/view/model/image.h"
#include "client/view/model/viewing.h"
#include "common/base/result.h"
#include "common/base/time_source.h"

namespace needlelab {

struct SurfaceOptions {
  enum class Kind : std::uint8_t {
    kWindow,     ///< needs a display (X11)
    kOffScreen,  ///< a picture through surfaceless EGL; no display, keyboard or mouse
    kAny,        ///< a window if there is a display, else off screen
  };
  Kind kind = Kind::kAny;
  std::string title = "needlelab";
  int width_px = 1280, height_px = 720;
  /// A window takes the whole of the primary monitor; `width_px` and `height_px` are the monitor's then.
  bool full_screen = false;
  /// Letters have the sizes for this place (letterSizes), in a window that is taken to fill the monitor.
  /// None: as on a desk, whatever the window's size.
  std::optional<Viewing> viewing;
  double font_scale = 1;     ///< 0.8 - 2.5, times those sizes
  double frames_per_s = 30;  ///< at most; 0: no pacing (off screen: as fast as possible)
  /// JSON: position, size and font scale of the window; read at the start, written at the end. Empty: no
  /// file. Unreadable files and positions off every monitor are ignored; with `full_screen` only the font
  /// scale counts, and the rest stays as it was.
  std::filesystem::path state_file;
  /// Decides when a frame is due. Must outlive the surface. Another than the machine's only off screen: a
  /// window also waits for its events, by the machine's time.
  TimeSource* time = &machineTime();
  /// The window's close button only makes a wish (takeCloseWish); the program then asks the person.
  bool asks_before_closing = false;
};

/// One window with its OpenGL 3.3 core context and Dear ImGui. Use:
///
///     while (surface->beginFrame()) {
///       … ImGui calls …
///       surface->endFrame();
///     }
///
/// Thread: one makes, uses and destroys it (GLFW: for a window, the process's first thread). A process has at
/// most one surface at a time. llvmpipe starts its worker threads while the surface is made, with the
/// affinity of the making thread: beside a haptic loop, make it within `KeepOffCore`
/// (client/station/run/real_time.h). The environment's LP_NUM_THREADS sets their number. If unset, `open`
/// sets it to 1 by setenv (so open the surface before making other threads, or set the variable yourself);
/// the view's own thread and one worker then share the cores of that affinity.
class Surface {
 public:
  /// Errors: kUnavailable; the message has advice (no display, no OpenGL 3.3, …). kInvalidInput: another time
  /// than the machine's, and not kOffScreen.
  static Result<std::unique_ptr<Surface>> open(const SurfaceOptions& options);
  /// Writes the state file.
  ~Surface();
  Surface(const Surface&) = delete;
  Surface& operator=(const Surface&) = delete;

  /// Sleeps until the frame is due (never spins), handles the window's events and begins an ImGui frame.
  /// Returns false, without a frame, once the window is closed.
  bool beginFrame();
  /// Draws the frame and shows it.
  void endFrame();
  /// Ends it: beginFrame returns false from then on.
  void close();
  /// With `asks_before_closing`: returns whether the window's close button was pressed since the last call.
  [[nodiscard]] bool takeCloseWish();

  [[nodiscard]] bool isWindow() const;
  [[nodiscard]] int width_px() const;
  [[nodiscard]] int height_px() const;
  /// Returns ImGui's time since the first frame. Off screen each frame takes exactly 1/frames_per_s (1/30 if
  /// that is 0), so that pictures of animations are reproducible.
  [[nodiscard]] double time_s() const;
  /// Returns the cost of the last frame in s: wall-clock time from beginFrame's return to the end of
  /// endFrame, without the swap's wait.
  [[nodiscard]] double frameCost_s() const;

  /// Returns the number of drawn frames. A frame equal to the one before is not drawn (except each 15th), so
  /// an idle window costs almost nothing.
  [[nodiscard]] std::uint64_t framesDrawn() const;

  [[nodiscard]] double fontScale() const;
  /// Clamped to 0.8 - 2.5; takes effect with the next frame.
  void setFontScale(double scale);

  /// Returns the last ended frame. Off screen the same calls give the same bytes.
  [[nodiscard]] RgbaImage picture() const;

  /// Off screen only: simulated input. It reaches the frames in its order, as a window's (input_queue.h):
  /// what is done at once before a frame is what a person does while the frame before it stands still. x to
  /// the right, y down, in pixels.
  void moveMouse(double x_px, double y_px);
  void setMouseButton(int button, bool down);  ///< 0 left, 1 right, 2 middle
  void scroll(double steps);
  void setKey(int glfw_key, bool down);  ///< e.g. GLFW_KEY_ENTER
  void typeText(const std::string& utf8);

 private:
  struct Parts;
  explicit Surface(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

/// Errors: kFailed, with the file's name. Rows from top to bottom.
Status savePng(const RgbaImage& image, const std::filesystem::path& file);
/// Errors: kNotFound, kCorrupt. For tests and reference pictures.
Result<RgbaImage> loadPng(const std::filesystem::path& file);

}  // namespace needlelab
