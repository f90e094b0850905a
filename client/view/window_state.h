/// Where a window stood, kept from one start to the next. Private to this folder.
#pragma once

#include <filesystem>
#include <optional>

#include "common/base/result.h"

namespace needlelab {

struct WindowState {
  int x_px = 0, y_px = 0, width_px = 1280, height_px = 720;
  double font_scale = 1;
};

/// Empty where there is no such file, or it says nothing usable (sizes of 320-16384, places within ±32768, a
/// scale of 0.8-2.5): a window must open whatever stands there.
std::optional<WindowState> readWindowState(const std::filesystem::path& file);
/// Makes the folder where it is missing.
Status writeWindowState(const std::filesystem::path& file, const WindowState& state);

}  // namespace needlelab
