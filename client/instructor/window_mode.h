/// The instructor with a window; exists only in builds with the station's parts.
#pragma once

#include <functional>

#include "client/instructor/terminal/options.h"
#include "common/base/result.h"

namespace needlelab {

/// Runs until the window is closed or `stopped` returns true. `options` must be checked. Errors:
/// kInvalidInput (password file), kUnavailable (no display, no OpenGL, or no window in this build).
Status runWindowMode(const InstructorOptions& options, const std::function<bool()>& stopped);

}  // namespace needlelab
