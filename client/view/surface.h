/// A surface to draw on: a window (GLFW) or an off-screen picture (surfaceless EGL), with the same frame loop
/// for both.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "client/view/model/mesh.h"
#include "client/view/surface_options.h"
#include "common/base/result.h"

namespace needlelab {

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
/// (client/station/run/loop/real_time.h). The environment's LP_NUM_THREADS sets their number. If unset,
/// `open` sets it to 1 by setenv (so open the surface before making other threads, or set the variable
/// yourself); the view's own thread and one worker then share the cores of that affinity.
class Surface {
 public:
  /// Errors: kUnavailable, with advice (no display, no OpenGL 3.3, …); kInvalidInput for a time source other
  /// than the machine's unless kOffScreen.
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
  /// Makes beginFrame return false from now on.
  void close();
  /// With `asks_before_closing`: returns whether the window's close button was pressed since the last call.
  [[nodiscard]] bool takeCloseRequest();

  [[nodiscard]] bool isWindow() const;
  [[nodiscard]] int width_px() const;
  [[nodiscard]] int height_px() const;
  /// Returns ImGui's time since the first frame. Off screen, each frame takes exactly 1/frames_per_s (1/30 if
  /// that is 0), so that pictures of animations are reproducible.
  [[nodiscard]] double time_s() const;
  /// Returns the cost of the last frame in s: wall-clock time from beginFrame's return to the end of
  /// endFrame, without the swap's wait.
  [[nodiscard]] double frameCost_s() const;

  /// Returns the number of drawn frames. A frame equal to the previous one is not drawn (except every 15th),
  /// so an idle window costs almost nothing.
  [[nodiscard]] std::uint64_t framesDrawn() const;

  [[nodiscard]] double fontScale() const;
  /// Clamped to 0.8 - 2.5; takes effect with the next frame.
  void setFontScale(double scale);

  /// Returns the last ended frame. Off screen, the same calls give the same bytes.
  [[nodiscard]] RgbaImage picture() const;

  /// Off screen only: simulated input. It reaches the frames in order, as in a window (input_queue.h). All
  /// input between two frames counts as made while the earlier one was visible. x to the right, y down, in
  /// pixels.
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
