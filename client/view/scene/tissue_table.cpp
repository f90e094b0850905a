#include "client/view/scene/scene_drawing.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "client/view/model/body/tissue_grain.h"
#include "client/view/model/palette.h"

namespace needlelab {
double deepestLayer_m(const SceneView& scene) {
  return scene.layers.back().bottom_m;
}

RgbaImage tissueTable(const SceneView& scene, double deepest_m) {
  RgbaImage image{kTableDepths, kTableAlong, {}};
  image.pixels.resize(4 * static_cast<std::size_t>(kTableDepths) * kTableAlong);
  // same line width in the picture for any scene size
  const double line_m = std::max(0.004 * scene.extent_m, 0.6 * deepest_m / kTableDepths);
  for (int x = 0; x < kTableDepths; ++x) {
    const double depth_m = (x + 0.5) / kTableDepths * deepest_m;
    const LayerView& layer = scene.layers[static_cast<std::size_t>(std::max(0, layerAt(scene, depth_m)))];
    const double from_top_m = depth_m - layer.top_m;
    double dark = 0.42 * std::exp(-(from_top_m / line_m) * (from_top_m / line_m));
    if (&layer != &scene.layers.back()) {
      const double to_bottom_m = layer.bottom_m - depth_m;
      dark = std::max(dark, 0.25 * std::exp(-(to_bottom_m / line_m) * (to_bottom_m / line_m)));
    }
    for (int y = 0; y < kTableAlong; ++y) {
      const double along = (y + 0.5) / kTableAlong;
      const Rgb base = layer.colour;
      const double light = (0.90 + tissuePattern(layer.kind, depth_m, along)) * (1 - dark);
      const auto byte = [&](float share) {
        return static_cast<std::uint8_t>(std::clamp(static_cast<double>(share) * light, 0.0, 1.0) * 255 +
                                         0.5);
      };
      std::uint8_t* pixel =
          &image.pixels[4 * (static_cast<std::size_t>(y) * kTableDepths + static_cast<std::size_t>(x))];
      pixel[0] = byte(base.red);
      pixel[1] = byte(base.green);
      pixel[2] = byte(base.blue);
      pixel[3] = 255;
    }
  }
  return image;
}

}  // namespace needlelab
