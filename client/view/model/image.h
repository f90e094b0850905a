/// Pictures as plain bytes.
#pragma once

#include <cstdint>
#include <vector>

namespace needlelab {

/// Rows from top to bottom, one byte per pixel, 0 black to 255 white.
struct GreyImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;  ///< width·height
};

/// Rows from top to bottom, four bytes per pixel: red, green, blue, opacity (sRGB).
struct RgbaImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;  ///< 4·width·height
};

}  // namespace needlelab
