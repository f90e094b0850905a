/// Boxes around the groups and structures of a field.
#include <algorithm>
#include <cmath>
#include <limits>

#include "common/anatomy/field.h"

namespace needlelab {

FieldBox common(const FieldBox& a, const FieldBox& b) {
  return {
      {std::max(a.low_m.x, b.low_m.x), std::max(a.low_m.y, b.low_m.y), std::max(a.low_m.z, b.low_m.z)},
      {std::min(a.high_m.x, b.high_m.x), std::min(a.high_m.y, b.high_m.y), std::min(a.high_m.z, b.high_m.z)}};
}

namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
constexpr FieldBox kNoPoint{{kUnbounded, kUnbounded, kUnbounded}, {-kUnbounded, -kUnbounded, -kUnbounded}};
constexpr FieldBox kEverywhere{{-kUnbounded, -kUnbounded, -kUnbounded}, {kUnbounded, kUnbounded, kUnbounded}};

FieldBox around(const FieldBox& a, const FieldBox& b) {
  return {
      {std::min(a.low_m.x, b.low_m.x), std::min(a.low_m.y, b.low_m.y), std::min(a.low_m.z, b.low_m.z)},
      {std::max(a.high_m.x, b.high_m.x), std::max(a.high_m.y, b.high_m.y), std::max(a.high_m.z, b.high_m.z)}};
}

}  // namespace

FieldBox Field::boxAround(std::size_t group, double beyond_m) const noexcept {
  // a smooth minimum of two is at most a quarter of the blend below them
  double grown_m = beyond_m;
  for (const Part& part : parts_)
    if (part.group == group) grown_m += 0.25 * part.blend_m;
  FieldBox box = kNoPoint;
  for (const Part& part : parts_) {
    if (part.group != group) continue;
    if (part.kind == Kind::kHalfSpace) return kEverywhere;
    const auto ball = [&](Vec3 center_m, Vec3 radii_m) {
      const Vec3 half{radii_m.x + grown_m, radii_m.y + grown_m, radii_m.z + grown_m};
      box = around(box, {center_m - half, center_m + half});
    };
    if (part.kind == Kind::kCapsule) {
      const double to_m = part.radius_m + part.growth_m;
      ball(part.a, {part.radius_m, part.radius_m, part.radius_m});
      ball(part.a + part.b, {to_m, to_m, to_m});
    } else {
      // the half height along a direction d is √Σ(rᵢ dᵢ)²
      const auto half = [&](double x, double y, double z) {
        return norm({part.b.x * x, part.b.y * y, part.b.z * z});
      };
      ball(part.a, {half(part.x.x, part.y.x, part.z.x), half(part.x.y, part.y.y, part.z.y),
                    half(part.x.z, part.y.z, part.z.z)});
    }
  }
  return box;
}

FieldBox Field::boxAround(StructureMask mask) const noexcept {
  const FieldBox body = boxAround(skin_, 0);
  if ((mask >> rest_ & 1u) != 0) return body;
  FieldBox box = kNoPoint;
  for (const Rule& rule : rules_) {
    if ((mask >> rule.structure & 1u) == 0) continue;
    FieldBox ruled = body;
    for (std::size_t i = 0; i < rule.count; ++i) {
      const Range& range = rule.ranges[i];
      if (range.to_m < kUnbounded) ruled = common(ruled, boxAround(range.group, std::max(range.to_m, 0.0)));
    }
    if (!ruled.empty()) box = around(box, ruled);
  }
  return box;
}

}  // namespace needlelab
