/// A piece of a field (Field::Piece).
#include <algorithm>
#include <cmath>

#include "common/anatomy/field.h"
#include "common/anatomy/field_joins.h"

namespace needlelab {

double Field::Piece::beyond(const Bound& bound, double distance_m) const noexcept {
  const Range& range = field_->rules_[bound.rule].ranges[bound.range];
  return bound.is_upper ? distance_m - range.to_m : range.from_m - distance_m;
}

void Field::Piece::add(std::size_t rule, bool is_asked) noexcept {
  const auto begin = static_cast<std::uint16_t>(bound_count_);
  for (std::size_t i = 0; rule < field_->rules_.size() && i < field_->rules_[rule].count; ++i) {
    const Range& range = field_->rules_[rule].ranges[i];
    const auto bound = [&](bool is_upper) {
      return Bound{static_cast<std::uint8_t>(rule), static_cast<std::uint8_t>(i), range.group, is_upper};
    };
    if (std::isfinite(range.from_m)) bounds_[bound_count_++] = bound(false);
    if (std::isfinite(range.to_m)) bounds_[bound_count_++] = bound(true);
  }
  rules_[rule_count_++] = {begin, static_cast<std::uint16_t>(bound_count_), is_asked};
}

Field::Piece Field::piece(StructureMask mask) const noexcept {
  Piece all;
  all.field_ = this;
  GroupMask groups = GroupMask{1} << skin_;
  const bool whole = isWhole(mask), with_rest = (mask >> rest_ & 1u) != 0;
  for (std::size_t k = 0; k < rules_.size() && !whole; ++k) {
    const Rule& rule = rules_[k];
    if (!with_rest && (rule.from_here & mask) == 0) break;
    all.add(k, (mask >> rule.structure & 1u) != 0);
    for (std::size_t i = 0; i < rule.count; ++i) groups |= GroupMask{1} << rule.ranges[i].group;
  }
  // what no rule takes: a rule without bounds holds everywhere
  if (whole || with_rest) all.add(rules_.size(), true);
  for (std::size_t i = 0; i < parts_.size(); ++i)
    if ((groups >> parts_[i].group & 1u) != 0) all.parts_[all.part_count_++] = static_cast<std::uint16_t>(i);
  return all;
}

// A part's exact distance with its slope, if that may be below a bound.
inline bool Field::Piece::slopeBelow(const Part& part, Vec3 p_m, double bound_m, FieldSlope& to) noexcept {
  if (part.kind == Kind::kCapsule) return capsuleBelow(part, p_m, bound_m, to);
  if (part.kind == Kind::kEllipsoid && bound_m < kInfinity && leastToEllipsoid(part, p_m) > bound_m)
    return false;
  to = slopeTo(part, p_m, true);
  return true;
}

// Outside of an ellipsoid: k0(k0 − 1)/k1, with k0 the distance in radii and k1/k0 its slope (Field::
// distanceToEllipsoid); no more than the distance, as k0 is convex.
double Field::Piece::leastToEllipsoid(const Part& part, Vec3 p_m) noexcept {
  const Vec3 d = p_m - part.a;
  const Vec3 u{dot(d, part.x) * part.inverses.x, dot(d, part.y) * part.inverses.y,
               dot(d, part.z) * part.inverses.z};
  const double k0 = norm(u);
  if (!(k0 > 1)) return -kInfinity;
  return k0 * (k0 - 1) / norm({u.x * part.inverses.x, u.y * part.inverses.y, u.z * part.inverses.z});
}

FieldSlope Field::Piece::at(Vec3 p_m) const noexcept {
  // parts of a group come one after the other
  std::array<Sloped, kMaxFieldGroups> distances;
  unsigned group = kMaxFieldGroups;
  for (std::size_t i = 0; i < part_count_; ++i) {
    const Part& part = field_->parts_[parts_[i]];
    Sloped& of_group = distances[part.group];
    const bool is_first = part.group != group;
    FieldSlope to;
    if (!slopeBelow(part, p_m, is_first ? kInfinity : of_group.value_m + part.blend_m, to)) continue;
    const Sloped distance(to.distance_m, to.slope);
    of_group = is_first ? distance : smoothMinimum(of_group, distance, part.blend_m);
    group = part.group;
  }
  // as Field::joined; of the greatest and the least only the bound is noted
  Sloped nearest(kInfinity), outside_others(-kInfinity);
  for (std::size_t i = 0; i < rule_count_; ++i) {
    const RuleBounds& rule = rules_[i];
    double rule_m = -kInfinity;
    const Bound* decides = nullptr;
    for (std::size_t k = rule.begin; k < rule.end; ++k) {
      const double bound_m = beyond(bounds_[k], distances[bounds_[k].group].value_m);
      if (decides == nullptr || bound_m > rule_m) rule_m = bound_m, decides = &bounds_[k];
    }
    const auto slope = [&](bool into) {
      if (decides == nullptr) return Vec3{};
      const Vec3 of_group = distances[decides->group].slope;
      return decides->is_upper == into ? of_group : of_group * -1.0;
    };
    if (!rule.is_asked) {
      if (-rule_m > outside_others.value_m) outside_others = {-rule_m, slope(false)};
    } else if (std::max(rule_m, outside_others.value_m) < nearest.value_m) {
      nearest = rule_m < outside_others.value_m ? outside_others : Sloped{rule_m, slope(true)};
    }
  }
  const Sloped& skin = distances[field_->skin_];
  if (skin_decides_ && skin.value_m > nearest.value_m) nearest = skin;
  return {nearest.value_m, nearest.slope};
}

// In the ball every distance is within `changes_m` of what it is in the middle: what is farther than twice
// that from deciding there is left out.
Field::Piece Field::Piece::within(Vec3 center_m, double radius_m) const noexcept {
  Piece left;
  left.field_ = field_;
  const double changes_m = field_->steep_ * radius_m + kRounding_m, apart_m = 2 * changes_m;
  std::array<double, kMaxFieldParts> part_m;
  Mattering mattering(true);
  for (std::size_t i = part_count_; i-- > 0;) {
    const Part& part = field_->parts_[parts_[i]];
    const double distance_m =
        part.kind == Kind::kEllipsoid ? exactDistanceToEllipsoid(part, center_m) : distanceTo(part, center_m);
    if (!mattering.matters(part, distance_m - changes_m, distance_m + changes_m)) continue;
    part_m[left.part_count_] = distance_m;
    left.parts_[left.part_count_++] = parts_[i];
  }
  std::reverse(left.parts_.begin(), left.parts_.begin() + left.part_count_);
  std::reverse(part_m.begin(), part_m.begin() + left.part_count_);
  Distances distances;
  std::fill_n(distances.begin(), field_->groups_, kFar_m);
  for (std::size_t i = 0; i < left.part_count_; ++i) {
    const Part& part = field_->parts_[left.parts_[i]];
    distances[part.group] = smoothMinimum(distances[part.group], part_m[i], part.blend_m);
  }

  // what each rule says in the middle, and the nearest of those that are asked for
  std::array<double, kMaxFieldRules + 1> rule_m, says_m;
  double nearest_m = kInfinity, outside_others_m = -kInfinity;
  for (std::size_t i = 0; i < rule_count_; ++i) {
    rule_m[i] = -kInfinity;
    for (std::size_t k = rules_[i].begin; k < rules_[i].end; ++k)
      rule_m[i] = std::max(rule_m[i], beyond(bounds_[k], distances[bounds_[k].group]));
    if (rules_[i].is_asked) {
      says_m[i] = std::max(rule_m[i], outside_others_m);
      nearest_m = std::min(nearest_m, says_m[i]);
    } else {
      says_m[i] = -rule_m[i];
      outside_others_m = std::max(outside_others_m, says_m[i]);
    }
  }
  left.skin_decides_ = skin_decides_ && !(distances[field_->skin_] < nearest_m - apart_m);
  // backwards: another structure's rule decides only what a later one that stays says
  std::array<bool, kMaxFieldRules + 1> stays;
  double least_later_m = kInfinity;
  for (std::size_t i = rule_count_; i-- > 0;) {
    stays[i] =
        rules_[i].is_asked ? !(says_m[i] > nearest_m + apart_m) : !(says_m[i] < least_later_m - apart_m);
    if (stays[i] && rules_[i].is_asked) least_later_m = std::min(least_later_m, says_m[i]);
  }
  GroupMask groups = left.skin_decides_ ? GroupMask{1} << field_->skin_ : 0;
  for (std::size_t i = 0; i < rule_count_; ++i) {
    if (!stays[i]) continue;
    const auto begin = static_cast<std::uint16_t>(left.bound_count_);
    const double decides_m = (rules_[i].is_asked ? says_m[i] : rule_m[i]) - apart_m;
    for (std::size_t k = rules_[i].begin; k < rules_[i].end; ++k) {
      if (beyond(bounds_[k], distances[bounds_[k].group]) < decides_m) continue;
      groups |= GroupMask{1} << bounds_[k].group;
      left.bounds_[left.bound_count_++] = bounds_[k];
    }
    left.rules_[left.rule_count_++] = {begin, static_cast<std::uint16_t>(left.bound_count_),
                                       rules_[i].is_asked};
  }
  const auto begin = left.parts_.begin(), end = begin + left.part_count_;
  left.part_count_ = static_cast<std::size_t>(
      std::remove_if(begin, end,
                     [&](std::uint16_t i) { return (groups >> field_->parts_[i].group & 1u) == 0; }) -
      begin);
  return left;
}

}  // namespace needlelab
