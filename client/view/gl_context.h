/// An OpenGL 3.3 core context, with a window or without. Private to this folder.
#pragma once

#include <memory>

#include "client/view/surface.h"
#include "common/base/result.h"

struct GLFWwindow;

namespace needlelab {

/// Current on the thread that made it until it is destroyed.
class GlContext {
 public:
  virtual ~GlContext() = default;
  /// Null off screen.
  [[nodiscard]] virtual GLFWwindow* window() const = 0;
  /// Shows what was drawn; may wait for the display.
  virtual void swap() = 0;
};

/// Where the options' state file says where the window stood, it is there again. Errors: kUnavailable.
Result<std::unique_ptr<GlContext>> makeWindowContext(const SurfaceOptions& options);
/// Errors: kUnavailable.
Result<std::unique_ptr<GlContext>> makeOffScreenContext();

}  // namespace needlelab
