/// An OpenGL 3.3 core context, with or without a window. Private to this folder.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "client/view/surface_options.h"
#include "common/base/result.h"

struct GLFWwindow;

namespace needlelab {

/// Current from construction to destruction on the thread that made it.
class GlContext {
 public:
  virtual ~GlContext() = default;
  /// Null off screen.
  [[nodiscard]] virtual GLFWwindow* window() const = 0;
  /// Shows the drawing; may wait for the display.
  virtual void swap() = 0;
};

/// Opens the window at its last position from the options' state file. Errors: kUnavailable.
Result<std::unique_ptr<GlContext>> makeWindowContext(const SurfaceOptions& options);
/// Errors: kUnavailable.
Result<std::unique_ptr<GlContext>> makeOffScreenContext();

/// Position and size of a window, kept between starts.
struct WindowState {
  int x_px = 0, y_px = 0, width_px = 1280, height_px = 720;
  double font_scale = 1;
};

/// Returns nullopt if the file is missing or has invalid values (sizes must be 320-16384, positions within
/// ±32768, the scale 0.8-2.5): a bad file must not prevent the window from opening.
std::optional<WindowState> readWindowState(const std::filesystem::path& file);
/// Creates the folder if missing.
Status writeWindowState(const std::filesystem::path& file, const WindowState& state);

}  // namespace needlelab
