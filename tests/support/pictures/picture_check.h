/// Compares pictures with their references.
///
/// A reference is a small PNG in git, `reference/NAME.png` beside the test. `NEEDLELAB_PICTURES_OUT=1` in the
/// environment rewrites the references (look at every one before you commit it). If a picture differs from
/// its reference, the test writes three PNGs to the folder named in the failure: the picture, the reference,
/// and the difference.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "client/view/model/mesh.h"

namespace needlelab::test {

/// In pixels of the picture, from its upper left corner.
struct PictureArea {
  int x = 0, y = 0, width = 0, height = 0;
};

/// Tolerances: other processors and versions of llvmpipe round differently at edges.
struct PictureTolerance {
  int per_channel = 28;            ///< of 255: smaller differences count as equal
  double share_of_pixels = 0.012;  ///< this share may differ more
  int shrink =
      2;  ///< before comparing, both are averaged over squares of this size (the reference is stored so)
  std::vector<PictureArea> passed_over;  ///< clocks, costs and other things that differ each time
};

/// The share of pixels that differ by more than `per_channel` in some channel; 1 if the sizes differ.
double shareThatDiffers(const RgbaImage& a, const RgbaImage& b, int per_channel);
/// Averaged over squares of `by` pixels; the remainder at the edges is cut off.
RgbaImage shrunk(const RgbaImage& image, int by);
/// Of a pixel, as 0xRRGGBB; 0 outside.
unsigned pixelAt(const RgbaImage& image, double x_px, double y_px);
/// The mean over a square of (2·half + 1) pixels, per channel 0-255.
struct MeanColour {
  double red = 0, green = 0, blue = 0;
};
MeanColour meanAround(const RgbaImage& image, double x_px, double y_px, int half);

/// `reference`: the whole path, including ".png".
::testing::AssertionResult looksLike(const RgbaImage& picture, const std::filesystem::path& reference,
                                     const PictureTolerance& tolerance = {});

}  // namespace needlelab::test
