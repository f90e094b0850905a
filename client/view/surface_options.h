/// Options of a surface (surface.h): window or picture, size, frame rate.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "client/view/model/letters.h"
#include "common/base/time/time_source.h"

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
  /// The window fills the primary monitor; `width_px` and `height_px` are then the monitor's.
  bool full_screen = false;
  /// Sizes letters for this viewing distance (letterSizes); assumes that the window fills the monitor. Empty:
  /// sizes for a desk, independent of the window's size.
  std::optional<Viewing> viewing;
  double font_scale = 1;     ///< 0.8 - 2.5, times those sizes
  double frames_per_s = 30;  ///< at most; 0: no pacing (off screen: as fast as possible)
  /// JSON file with the window's position, size and font scale; read at the start, written at the end. Empty:
  /// no file. Ignores unreadable files and positions outside all monitors. With `full_screen` only the font
  /// scale is used and updated.
  std::filesystem::path state_file;
  /// Decides when a frame is due. Must outlive the surface. Only off screen may it differ from the machine's:
  /// a window also waits for its events, by the machine's time.
  TimeSource* time = &machineTime();
  /// The window's close button only sets takeCloseRequest; the program then asks the user.
  bool asks_before_closing = false;
};

}  // namespace needlelab
