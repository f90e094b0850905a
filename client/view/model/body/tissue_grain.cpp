#include "client/view/model/body/tissue_grain.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "common/profile/structure_kinds.h"

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
  const int cells = std::max(2, static_cast<int>(std::lround(kGrainPeriod_m / along_m)));
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

constexpr int kSide = 240;

}  // namespace

double tissuePattern(pb::Volume::Structure::Kind kind, double depth_m, double along) {
  return patternOf(structureKind(kind).tissue, depth_m, along);
}

TissueGrain::TissueGrain(pb::Layer::Tissue tissue) {
  values_.reserve(static_cast<std::size_t>(kSide) * kSide);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x)
      values_.push_back(
          static_cast<float>(patternOf(tissue, (y + 0.5) / kSide * kGrainPeriod_m, (x + 0.5) / kSide)));
}

float TissueGrain::at(double depth_m, double along_m) const {
  const int steps = static_cast<int>(std::floor(depth_m / kGrainPeriod_m * kSide));
  const int twice = ((steps % (2 * kSide)) + 2 * kSide) % (2 * kSide);
  const int y = twice < kSide ? twice : 2 * kSide - 1 - twice;
  const int x = ((static_cast<int>(std::floor(along_m / kGrainPeriod_m * kSide)) % kSide) + kSide) % kSide;
  return values_[static_cast<std::size_t>(y) * kSide + static_cast<std::size_t>(x)];
}

const TissueGrain& tissueGrain(pb::Volume::Structure::Kind kind) {
  static const std::vector<TissueGrain> all = [] {
    std::vector<TissueGrain> made;
    for (int i = 0; i <= pb::Layer::Tissue_MAX; ++i) made.emplace_back(static_cast<pb::Layer::Tissue>(i));
    return made;
  }();
  return all[static_cast<std::size_t>(structureKind(kind).tissue)];
}

}  // namespace needlelab
