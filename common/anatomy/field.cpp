#include "common/anatomy/field.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "common/anatomy/field_joins.h"

namespace needlelab {
namespace {

/// The signed distance of a point from an ellipsoid with the radii r, both along its axes: the nearest point
/// of the surface is q = r² p/(t + r²), where t is the greatest root of F(t) = Σ (r p/(t + r²))² − 1 (Eberly,
/// "Distance from a Point to an Ellipse, an Ellipsoid, or a Hyperellipsoid"). F falls and is convex there:
/// Newton's step from any place ends up left of the root, and further steps approach it without passing it.
/// The first step starts at t = 0, the surface.
/// `out`: becomes the surface's normal there, which is the distance's slope.
double nearestOnEllipsoid(Vec3 p_m, Vec3 r_m, Vec3* out = nullptr) noexcept {
  constexpr double kOnAxis_m = 1e-9;  // on a plane of symmetry the root would be at the pole
  const double last_step_m2 = 1e-9 * std::min({r_m.x, r_m.y, r_m.z});  // half a nanometre off
  const Vec3 p{std::max(std::fabs(p_m.x), kOnAxis_m), std::max(std::fabs(p_m.y), kOnAxis_m),
               std::max(std::fabs(p_m.z), kOnAxis_m)};
  const Vec3 squares{r_m.x * r_m.x, r_m.y * r_m.y, r_m.z * r_m.z};
  const Vec3 products{r_m.x * p.x, r_m.y * p.y, r_m.z * p.z};
  // F ≥ 0 here: left of the root
  const double left = std::max({products.x - squares.x, products.y - squares.y, products.z - squares.z});
  double t = 0;
  Vec3 inverse;
  for (int i = 0; i < 30; ++i) {
    inverse = {1 / (t + squares.x), 1 / (t + squares.y), 1 / (t + squares.z)};
    const Vec3 u{products.x * inverse.x, products.y * inverse.y, products.z * inverse.z};
    const Vec3 uu{u.x * u.x, u.y * u.y, u.z * u.z};
    const double step = (uu.x + uu.y + uu.z - 1) / (2 * dot(uu, inverse));
    if (std::fabs(step) < last_step_m2) break;
    t = std::max(t + step, left);
  }
  const Vec3 outwards{p.x * inverse.x, p.y * inverse.y, p.z * inverse.z};
  const double length = norm(outwards);
  if (out != nullptr)
    *out = Vec3{std::copysign(outwards.x, p_m.x), std::copysign(outwards.y, p_m.y),
                std::copysign(outwards.z, p_m.z)} /
           length;
  return t * length;
}

}  // namespace

double Field::distanceToEllipsoid(const Part& part, Vec3 p_m, Vec3* slope) noexcept {
  const Vec3 d = p_m - part.a;
  const Vec3 own{dot(d, part.x), dot(d, part.y), dot(d, part.z)};
  const Vec3 u{own.x * part.inverses.x, own.y * part.inverses.y, own.z * part.inverses.z};
  const double k0 = norm(u);
  // k0 is convex and at most 1/least steep, which gives bounds where nothing asks for more. (They are too
  // small, outside and inside; a smooth minimum is not steeper than its parts.)
  const Vec3 w{u.x * part.inverses.x, u.y * part.inverses.y, u.z * part.inverses.z};  // k0 times its slope
  const auto turned = [&](Vec3 in_own) { return part.x * in_own.x + part.y * in_own.y + part.z * in_own.z; };
  if (k0 > 1) {
    const double k1 = norm(w);
    const double at_least_m = k0 * (k0 - 1) / k1;
    if (at_least_m > part.reach_m) {
      const Vec3 k1_slope =
          Vec3{w.x * part.inverses.x * part.inverses.x, w.y * part.inverses.y * part.inverses.y,
               w.z * part.inverses.z * part.inverses.z} /
          k1;
      if (slope != nullptr) *slope = turned((w * ((2 * k0 - 1) / k0) - k1_slope * at_least_m) / k1);
      return at_least_m;
    }
  } else {
    const double least_m = std::min({part.b.x, part.b.y, part.b.z});
    const double at_least_m = (1 - k0) * least_m;
    if (at_least_m > part.ruled_m) {
      if (slope != nullptr) *slope = k0 > 0 ? turned(w * (least_m / k0)) : Vec3{};
      return -at_least_m;
    }
  }
  return exactDistanceToEllipsoid(part, p_m, slope);
}

double Field::exactDistanceToEllipsoid(const Part& part, Vec3 p_m, Vec3* slope) noexcept {
  const Vec3 d = p_m - part.a;
  Vec3 out;
  const double distance_m = nearestOnEllipsoid({dot(d, part.x), dot(d, part.y), dot(d, part.z)}, part.b,
                                               slope != nullptr ? &out : nullptr);
  if (slope != nullptr) *slope = part.x * out.x + part.y * out.y + part.z * out.z;
  return distance_m;
}

double Field::distanceTo(const Part& part, Vec3 p_m) noexcept {
  switch (part.kind) {
    case Kind::kCapsule: {
      const Vec3 from_a = p_m - part.a;
      const double along = std::min(std::max(dot(from_a, part.b) * part.inverse, 0.0), 1.0);
      return norm(from_a - part.b * along) - (part.radius_m + part.growth_m * along);
    }
    case Kind::kEllipsoid:
      return distanceToEllipsoid(part, p_m);
    case Kind::kHalfSpace:
      return dot(p_m - part.a, part.b);
  }
  return kFar_m;
}

void Field::join(const Part& part, Vec3 p_m, Distances& distances) noexcept {
  double& group = distances[part.group];
  group = smoothMinimum(group, distanceTo(part, p_m), part.blend_m);
}

bool Field::capsuleBelow(const Part& part, Vec3 p_m, double bound_m, FieldSlope& to) noexcept {
  const Vec3 from_a = p_m - part.a;
  const double free = dot(from_a, part.b) * part.inverse, along = std::min(std::max(free, 0.0), 1.0);
  const Vec3 off = from_a - part.b * along;
  const double length_m = norm(off);
  to.distance_m = length_m - (part.radius_m + part.growth_m * along);
  if (to.distance_m > bound_m) return false;
  to.slope = length_m > 0 ? off / length_m : Vec3{};
  if (free > 0 && free < 1) to.slope = to.slope - part.b * (part.growth_m * part.inverse);
  return true;
}

FieldSlope Field::slopeTo(const Part& part, Vec3 p_m, bool exact) noexcept {
  if (part.kind == Kind::kEllipsoid) {
    FieldSlope to;
    to.distance_m =
        exact ? exactDistanceToEllipsoid(part, p_m, &to.slope) : distanceToEllipsoid(part, p_m, &to.slope);
    return to;
  }
  if (part.kind == Kind::kHalfSpace) return {distanceTo(part, p_m), part.b};
  FieldSlope to;
  static_cast<void>(capsuleBelow(part, p_m, kInfinity, to));
  return to;
}

FieldPoint Field::judge(const Distances& distances, GroupMask far, GroupMask deep) const noexcept {
  const double skin_m = distances[skin_];
  if (skin_m >= 0) return {kOutside, skin_m / steep_};
  double clearance_m = -skin_m;
  for (const Rule& rule : rules_) {
    if ((rule.near & far) != 0 || (rule.outside & deep) != 0) continue;
    // A rule that fails is as far away as its farthest failing range; one that holds lasts to its nearest
    // bound.
    bool holds = true;
    double outside_m = -kInfinity;
    for (std::size_t i = 0; i < rule.count; ++i) {
      const Range& range = rule.ranges[i];
      const double value_m = distances[range.group];
      holds = holds && value_m >= range.from_m && value_m < range.to_m;
      outside_m = std::max({outside_m, range.from_m - value_m, value_m - range.to_m});
    }
    clearance_m = std::min(clearance_m, std::fabs(outside_m));
    if (holds) return {rule.structure, clearance_m / steep_};
  }
  return {rest_, clearance_m / steep_};
}

void Field::distancesAt(Vec3 p_m, Distances& distances) const noexcept {
  std::fill_n(distances.begin(), groups_, kFar_m);
  for (const Part& part : parts_) join(part, p_m, distances);
}

FieldPoint Field::at(Vec3 p_m) const noexcept {
  Distances distances;
  distancesAt(p_m, distances);
  return judge(distances);
}

double Field::skinDistance(Vec3 p_m) const noexcept {
  double distance_m = kFar_m;
  for (const Part& part : parts_) {
    if (part.group != skin_) continue;
    const double part_m =
        part.kind == Kind::kEllipsoid ? exactDistanceToEllipsoid(part, p_m) : distanceTo(part, p_m);
    distance_m = smoothMinimum(distance_m, part_m, part.blend_m);
  }
  return distance_m;
}

double Field::structuresDistance(StructureMask mask, Vec3 p_m) const noexcept {
  Distances distances;
  std::fill_n(distances.begin(), groups_, kFar_m);
  const GroupMask groups = groupsOf(mask);
  for (const Part& part : parts_)
    if ((groups >> part.group & 1u) != 0) join(part, p_m, distances);
  return joined(mask, distances);
}

template <class Number>
Number Field::joined(StructureMask mask,
                     const std::array<Number, kMaxFieldGroups>& distances) const noexcept {
  // a rule's points are within all of its ranges, and outside of the rules before it
  if (isWhole(mask)) return distances[skin_];
  const bool with_rest = (mask >> rest_ & 1u) != 0;
  Number nearest_m = kInfinity, outside_others_m = -kInfinity;
  for (const Rule& rule : rules_) {
    if (!with_rest && (rule.from_here & mask) == 0) break;
    Number rule_m = -kInfinity;
    for (std::size_t i = 0; i < rule.count; ++i) {
      const Range& range = rule.ranges[i];
      rule_m = std::max({rule_m, Number(range.from_m) - distances[range.group],
                         distances[range.group] - Number(range.to_m)});
    }
    if ((mask >> rule.structure & 1u) != 0)
      nearest_m = std::min(nearest_m, std::max(rule_m, outside_others_m));
    else
      outside_others_m = std::max(outside_others_m, -rule_m);
  }
  if (with_rest) nearest_m = std::min(nearest_m, outside_others_m);
  return std::max(nearest_m, distances[skin_]);
}

double Field::distance(std::size_t group, Vec3 p_m) const noexcept {
  assert(group < groups_);
  Distances distances;
  distances.fill(kFar_m);
  for (const Part& part : parts_)
    if (part.group == group) join(part, p_m, distances);
  return distances[group];
}

Field::OnLine Field::onLine(Vec3 origin_m, Vec3 axis) const noexcept {
  assert(std::fabs(normSquared(axis) - 1) < 1e-9);
  OnLine line;
  line.field_ = this;
  line.origin_m_ = origin_m;
  line.axis_ = axis;
  for (std::size_t i = 0; i < balls_.size(); ++i) {
    const Vec3 off = balls_[i].center_m - origin_m;
    const double along_m = dot(off, axis);
    const double half_squared = balls_[i].radius_m * balls_[i].radius_m - normSquared(off - axis * along_m);
    if (half_squared < 0) continue;
    const double half_m = std::sqrt(half_squared);
    line.reaches_[line.count_++] = {along_m - half_m - kRounding_m, along_m + half_m + kRounding_m,
                                    static_cast<std::uint16_t>(i)};
  }
  return line;
}

Field::Stretch Field::OnLine::between(double from_m, double to_m) const noexcept {
  Stretch stretch;
  stretch.field_ = field_;
  stretch.origin_m_ = origin_m_;
  stretch.axis_ = axis_;
  std::fill_n(stretch.without_m_.begin(), field_->groups_, kFar_m);
  const Vec3 middle_m = point(0.5 * (from_m + to_m));
  const double changes_m = field_->steep_ * 0.5 * (to_m - from_m) + kRounding_m;
  GroupMask near = 0;
  Mattering mattering;
  for (std::size_t i = count_; i-- > 0;) {
    if (reaches_[i].from_m > to_m || reaches_[i].to_m < from_m) continue;
    const Part& part = field_->parts_[reaches_[i].part];
    const GroupMask group = GroupMask{1} << part.group;
    if ((stretch.deep_ & group) != 0) continue;
    const double distance_m = distanceTo(part, middle_m);
    if (!mattering.matters(part, distance_m - changes_m, distance_m + changes_m)) continue;
    near |= group;
    if (distance_m + changes_m < -part.ruled_m) {
      // nothing else of its group matters: a minimum is no greater
      stretch.deep_ |= group;
      stretch.without_m_[part.group] = distance_m + changes_m;
    }
    stretch.parts_[stretch.count_++] = reaches_[i].part;
  }
  stretch.far_ = ~near;
  const auto begin = stretch.parts_.begin();
  std::reverse(begin, begin + stretch.count_);
  if (stretch.deep_ == 0) return stretch;
  const auto end = std::remove_if(begin, begin + stretch.count_, [&](std::uint16_t i) {
    return (stretch.deep_ >> field_->parts_[i].group & 1u) != 0;
  });
  stretch.count_ = static_cast<std::size_t>(end - begin);
  return stretch;
}

FieldPoint Field::Stretch::at(double t_m) const noexcept {
  const Vec3 p_m = origin_m_ + axis_ * t_m;
  Distances distances;
  std::copy_n(without_m_.begin(), field_->groups_, distances.begin());
  for (std::size_t i = 0; i < count_; ++i) join(field_->parts_[parts_[i]], p_m, distances);
  return field_->judge(distances, far_, deep_);
}

bool Field::isWhole(StructureMask mask) const noexcept {
  const StructureMask all =
      structures_.size() >= kMaxFieldStructures ? kWholeBody : (StructureMask{1} << structures_.size()) - 1;
  return (mask & all) == all;
}

Field::InBall Field::inBallOf(GroupMask groups, Vec3 center_m, double radius_m) const noexcept {
  InBall ball;
  ball.field_ = this;
  const double changes_m = steep_ * radius_m + kRounding_m;
  Mattering mattering;
  for (std::size_t i = balls_.size(); i-- > 0;) {
    const double near_m = balls_[i].radius_m + radius_m;
    const Part& part = parts_[i];
    if ((groups >> part.group & 1u) == 0 || normSquared(balls_[i].center_m - center_m) > near_m * near_m)
      continue;
    const double distance_m = distanceTo(part, center_m);
    if (mattering.matters(part, distance_m - changes_m, distance_m + changes_m))
      ball.parts_[ball.count_++] = static_cast<std::uint16_t>(i);
  }
  std::reverse(ball.parts_.begin(), ball.parts_.begin() + ball.count_);
  return ball;
}

Field::InBall Field::inBall(Vec3 center_m, double radius_m) const noexcept {
  return inBallOf(~GroupMask{0}, center_m, radius_m);
}

Field::GroupMask Field::groupsOf(StructureMask mask) const noexcept {
  GroupMask groups = GroupMask{1} << skin_;
  if (isWhole(mask)) return groups;
  for (const Rule& rule : rules_) {
    if ((mask >> rest_ & 1u) == 0 && (rule.from_here & mask) == 0) break;
    for (std::size_t i = 0; i < rule.count; ++i) groups |= GroupMask{1} << rule.ranges[i].group;
  }
  return groups;
}

Field::InBall Field::inBall(Vec3 center_m, double radius_m, StructureMask mask) const noexcept {
  return inBallOf(groupsOf(mask), center_m, radius_m);
}

Field::InBall Field::InBall::inBall(Vec3 center_m, double radius_m) const noexcept {
  InBall ball;
  ball.field_ = field_;
  const double changes_m = field_->steep_ * radius_m + kRounding_m;
  Mattering mattering(true);
  for (std::size_t i = count_; i-- > 0;) {
    const Part& part = field_->parts_[parts_[i]];
    const double distance_m = distanceTo(part, center_m);
    if (mattering.matters(part, distance_m - changes_m, distance_m + changes_m))
      ball.parts_[ball.count_++] = parts_[i];
  }
  std::reverse(ball.parts_.begin(), ball.parts_.begin() + ball.count_);
  return ball;
}

FieldPoint Field::InBall::at(Vec3 p_m) const noexcept {
  Distances distances;
  std::fill_n(distances.begin(), field_->groups_, kFar_m);
  for (std::size_t i = 0; i < count_; ++i) join(field_->parts_[parts_[i]], p_m, distances);
  return field_->judge(distances);
}

double Field::InBall::structuresDistance(StructureMask mask, Vec3 p_m) const noexcept {
  Distances distances;
  std::fill_n(distances.begin(), field_->groups_, kFar_m);
  for (std::size_t i = 0; i < count_; ++i) join(field_->parts_[parts_[i]], p_m, distances);
  return field_->joined(mask, distances);
}

FieldSlope Field::InBall::slope(StructureMask mask, Vec3 p_m) const noexcept {
  std::array<Sloped, kMaxFieldGroups> distances;
  std::fill_n(distances.begin(), field_->groups_, kFar_m);
  for (std::size_t i = 0; i < count_; ++i) {
    const Part& part = field_->parts_[parts_[i]];
    const FieldSlope to = slopeTo(part, p_m);
    Sloped& group = distances[part.group];
    group = smoothMinimum(group, Sloped(to.distance_m, to.slope), part.blend_m);
  }
  const Sloped slope = field_->joined(mask, distances);
  return {slope.value_m, slope.slope};
}

}  // namespace needlelab
