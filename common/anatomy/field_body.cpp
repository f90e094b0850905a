#include "common/anatomy/field_body.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/anatomy/march.h"

namespace needlelab {
namespace {

/// Half the distance between the two places that a slope is taken from: far more than rounding, far less than
/// any radius.
constexpr double kHalf_m = 2e-5;
/// A surface is found to this, in at most kSteps steps along its normal.
constexpr double kOnSurface_m = 1e-7;
constexpr int kSteps = 4;

/// The direction in which a distance grows, by central differences; zero where it has none.
template <class Distance>
Vec3 directionOf(const Distance& distance, Vec3 p_m) noexcept {
  const Vec3 slope{distance(p_m + Vec3{kHalf_m, 0, 0}) - distance(p_m - Vec3{kHalf_m, 0, 0}),
                   distance(p_m + Vec3{0, kHalf_m, 0}) - distance(p_m - Vec3{0, kHalf_m, 0}),
                   distance(p_m + Vec3{0, 0, kHalf_m}) - distance(p_m - Vec3{0, 0, kHalf_m})};
  const double size = norm(slope);
  return size > 1e-9 * kHalf_m ? slope / size : Vec3{};
}

}  // namespace

FieldBody::FieldBody(Field field) : field_(std::move(field)) {}

double FieldBody::depth(Vec3 p_m) const noexcept {
  return -field_.skinDistance(p_m);
}

Vec3 FieldBody::normal(Vec3 p_m) const noexcept {
  return directionOf([this](Vec3 p) { return field_.skinDistance(p); }, p_m);
}

StructureIndex FieldBody::structureAt(Vec3 p_m) const noexcept {
  return field_.at(p_m).structure;
}

LayerStack FieldBody::layersAlong(Vec3 from_m, Vec3 axis, double reach_m, double min_layer_m) const noexcept {
  MarchOptions options;
  options.reach_m = reach_m;
  options.min_layer_m = min_layer_m;
  return march(field_, from_m, axis, options);
}

BonesNear FieldBody::bonesNear(Vec3 p_m, double within_m) const noexcept {
  BonesNear near;
  std::array<double, kMaxBonePlanes> away_m{};
  for (std::size_t i = 0; i < field_.structures().size(); ++i) {
    if (!field_.structures()[i].layer.is_bone) continue;
    const auto distance = [&](Vec3 p) { return field_.structuresDistance(1u << i, p); };
    double from_m = distance(p_m);
    if (std::fabs(from_m) > within_m) continue;
    // along the normal to the surface
    Vec3 at_m = p_m, normal = directionOf(distance, at_m);
    for (int step = 0; step < kSteps && std::fabs(from_m) > kOnSurface_m; ++step) {
      at_m = at_m - normal * from_m;
      from_m = distance(at_m);
      normal = directionOf(distance, at_m);
    }
    if (normal == Vec3{}) continue;
    const double so_far_m = std::fabs(dot(p_m - at_m, normal));
    // sorted in; the farthest is dropped if there are too many
    std::size_t place = near.count;
    while (place > 0 && away_m[place - 1] > so_far_m) --place;
    if (place == kMaxBonePlanes) continue;
    near.count = std::min(near.count + 1, kMaxBonePlanes);
    for (std::size_t later = near.count - 1; later > place; --later) {
      near.planes[later] = near.planes[later - 1];
      away_m[later] = away_m[later - 1];
    }
    near.planes[place] = {at_m, normal, static_cast<StructureIndex>(i)};
    away_m[place] = so_far_m;
  }
  return near;
}

}  // namespace needlelab
