#include "client/view/scene/scene_drawing.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "client/view/model/palette.h"

namespace needlelab {
namespace {

// Random values 0-1 at lattice points.
double latticeValue(int x, int y, std::uint32_t seed) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 0x9E3779B1u ^
                    static_cast<std::uint32_t>(y) * 0x85EBCA77u ^ seed * 0xC2B2AE3Du;
  h ^= h >> 15;
  h *= 0x2C1B3C6Du;
  h ^= h >> 12;
  h *= 0x297A2D39u;
  h ^= h >> 15;
  return static_cast<double>(h) / 4294967295.0;
}

/// Smooth noise from -1 to 1 around 0; repeats after `cells` in y.
double smoothNoise(double x, double y, int cells, std::uint32_t seed) {
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
  const auto eased = [](double t) { return t * t * (3 - 2 * t); };
  const double tx = eased(x - x0), ty = eased(y - y0);
  const auto at = [&](int dx, int dy) {
    return latticeValue(x0 + dx, ((y0 + dy) % cells + cells) % cells, seed);
  };
  const double low = at(0, 0) + (at(1, 0) - at(0, 0)) * tx, high = at(0, 1) + (at(1, 1) - at(0, 1)) * tx;
  return 2 * (low + (high - low) * ty) - 1;
}

// Grain with a size across and along the layers, in m.
double grain(double depth_m, double along_share, double across_m, double along_m, std::uint32_t seed) {
  const int cells = std::max(2, static_cast<int>(std::lround(kTablePeriod_m / along_m)));
  return smoothNoise(depth_m / across_m, along_share * cells, cells, seed);
}

double patternOf(pb::Layer::Tissue tissue, double d, double s) {
  switch (tissue) {
    case pb::Layer::SKIN:
      return 0.05 * grain(d, s, 0.0004, 0.0005, 1) + 0.04 * grain(d, s, 0.0015, 0.003, 2);
    case pb::Layer::FAT:
      return 0.10 * std::fabs(grain(d, s, 0.0016, 0.0022, 3)) -
             0.05 * std::fabs(grain(d, s, 0.0007, 0.001, 4));
    case pb::Layer::MUSCLE:
      return 0.11 * grain(d, s, 0.0006, 0.008, 5) + 0.08 * grain(d, s, 0.0018, 0.012, 6);
    case pb::Layer::TENDON:
      return 0.07 * grain(d, s, 0.0003, 0.012, 7) + 0.04 * grain(d, s, 0.0009, 0.012, 8);
    case pb::Layer::CAPSULE:
      return 0.06 * grain(d, s, 0.0004, 0.006, 9);
    case pb::Layer::BONE:
      return 0.07 * grain(d, s, 0.0009, 0.0011, 10) + 0.05 * grain(d, s, 0.0025, 0.003, 11);
    case pb::Layer::CARTILAGE:
      return 0.03 * grain(d, s, 0.001, 0.004, 12);
    default:
      return 0.03 * grain(d, s, 0.002, 0.006, 13);
  }
}

}  // namespace

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
      const Rgb base = tissueColour(layer.tissue);
      const double light = (0.90 + patternOf(layer.tissue, depth_m, along)) * (1 - dark);
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
