/// An OpenGL 3.3 core context, with a window or without. Private to this folder.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "client/view/surface.h"
#include "common/base/result.h"

struct GLFWwindow;

namespace needlelab {

/// It is current on the thread that made it until it is destroyed.
class GlContext {
 public:
  virtual ~GlContext() = default;
  /// Null off screen.
  [[nodiscard]] virtual GLFWwindow* window() const = 0;
  /// Shows what was drawn; may wait for the display.
  virtual void swap() = 0;
};

/// Opens the window where the options' state file says that it stood the last time. Errors: kUnavailable.
Result<std::unique_ptr<GlContext>> makeWindowContext(const SurfaceOptions& options);
/// Errors: kUnavailable.
Result<std::unique_ptr<GlContext>> makeOffScreenContext();

/// The place and size of a window, kept from one start to the next.
struct WindowState {
  int x_px = 0, y_px = 0, width_px = 1280, height_px = 720;
  double font_scale = 1;
};

/// Empty when there is no such file, or when its values are not usable (sizes of 320-16384, places within
/// ±32768, a scale of 0.8-2.5): a window must open whatever the file says.
std::optional<WindowState> readWindowState(const std::filesystem::path& file);
/// Makes the folder when it is missing.
Status writeWindowState(const std::filesystem::path& file, const WindowState& state);

}  // namespace needlelab
