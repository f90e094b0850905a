// A field made from its spec.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "common/anatomy/field.h"

namespace needlelab {
namespace {

std::size_t indexOf(const std::vector<FieldGroup>& groups, const std::string& id) {
  const auto found =
      std::find_if(groups.begin(), groups.end(), [&](const auto& one) { return one.id == id; });
  assert(found != groups.end());
  return static_cast<std::size_t>(found - groups.begin());
}

StructureIndex indexOf(const std::vector<FieldStructure>& structures, const std::string& id) {
  const auto found =
      std::find_if(structures.begin(), structures.end(), [&](const auto& one) { return one.id == id; });
  assert(found != structures.end());
  return static_cast<StructureIndex>(found - structures.begin());
}

}  // namespace

void Field::addSegment(std::uint8_t group, double blend_m, const CapsulePart& capsule) {
  Part part{};
  part.kind = Kind::kCapsule;
  part.group = group;
  part.blend_m = blend_m;
  part.a = capsule.a_m;
  part.b = capsule.b_m - capsule.a_m;
  part.radius_m = capsule.radius_a_m;
  part.growth_m = capsule.radius_b_m - capsule.radius_a_m;
  const double length_squared = normSquared(part.b);
  part.inverse = length_squared > 0 ? 1 / length_squared : 0;
  steep_ = std::max(steep_, std::sqrt(1 + part.growth_m * part.growth_m * part.inverse));
  parts_.push_back(part);
  balls_.push_back(
      {capsule.a_m + part.b * 0.5, 0.5 * norm(part.b) + std::max(capsule.radius_a_m, capsule.radius_b_m)});
}

void Field::addPart(std::uint8_t group, const FieldPart& spec) {
  if (const auto* const capsule = std::get_if<CapsulePart>(&spec.shape)) {
    addSegment(group, spec.blend_m, *capsule);
    numbers_ += 9;
  } else if (const auto* const tube = std::get_if<TubePart>(&spec.shape)) {
    for (std::size_t i = 1; i < tube->points.size(); ++i) {
      const TubePart::Point &from = tube->points[i - 1], &to = tube->points[i];
      // the first piece blends with the group; its followers share a ball with the piece before
      addSegment(group, i == 1 ? spec.blend_m : 0, {from.at_m, to.at_m, from.radius_m, to.radius_m});
    }
    numbers_ += 4 * tube->points.size() + 1;
  } else if (const auto* const ellipsoid = std::get_if<EllipsoidPart>(&spec.shape)) {
    Part part{};
    part.kind = Kind::kEllipsoid;
    part.group = group;
    part.blend_m = spec.blend_m;
    part.a = ellipsoid->center_m;
    part.b = ellipsoid->radii_m;
    part.inverses = {1 / part.b.x, 1 / part.b.y, 1 / part.b.z};
    part.x = normalized(ellipsoid->x_axis);
    part.z = normalized(cross(part.x, ellipsoid->y_axis));
    part.y = cross(part.z, part.x);
    parts_.push_back(part);
    balls_.push_back({part.a, std::max({part.b.x, part.b.y, part.b.z})});
    numbers_ += 13;
  } else {
    const auto& half_space = std::get<HalfSpacePart>(spec.shape);
    Part part{};
    part.kind = Kind::kHalfSpace;
    part.group = group;
    part.blend_m = spec.blend_m;
    part.a = half_space.point_m;
    part.b = normalized(half_space.normal);
    parts_.push_back(part);
    balls_.push_back({part.a, kInfinity});
    numbers_ += 7;
  }
}

Result<Field> Field::make(const FieldSpec& spec) {
  RETURN_IF_ERROR(checkField(spec));
  Field field;
  field.structures_ = spec.structures;
  field.skin_ = indexOf(spec.groups, spec.skin);
  field.rest_ = indexOf(spec.structures, spec.rest);
  for (const FieldGroup& group : spec.groups) {
    const auto index = static_cast<std::uint8_t>(field.groups_++);
    for (const FieldPart& part : group.parts) field.addPart(index, part);
  }
  for (const FieldRule& rule : spec.rules) {
    Rule compiled{};
    compiled.structure = indexOf(spec.structures, rule.structure);
    const auto add = [&](const FieldRange& range) {
      compiled.ranges[compiled.count++] = {static_cast<std::uint8_t>(indexOf(spec.groups, range.group)),
                                           range.from_m, range.to_m};
      const GroupMask group = GroupMask{1} << compiled.ranges[compiled.count - 1].group;
      if (range.to_m < kInfinity) compiled.near |= group;
      if (range.from_m > -kInfinity) compiled.outside |= group;
      field.numbers_ += (range.from_m > -kInfinity) + (range.to_m < kInfinity);
    };
    add(rule.range);
    for (const FieldRange& clip : rule.clips) add(clip);
    field.rules_.push_back(compiled);
  }
  StructureMask from_here = 0;
  for (auto rule = field.rules_.rbegin(); rule != field.rules_.rend(); ++rule)
    rule->from_here = from_here |= maskOf(rule->structure);

  // how far from a group its distance still decides something
  std::array<double, kMaxFieldGroups> ruled_m{}, blends_m{};
  for (const Rule& rule : field.rules_) {
    for (std::size_t i = 0; i < rule.count; ++i) {
      const Range& range = rule.ranges[i];
      for (const double bound : {range.from_m, range.to_m})
        if (std::isfinite(bound)) ruled_m[range.group] = std::max(ruled_m[range.group], std::fabs(bound));
    }
  }
  for (std::size_t i = field.parts_.size(); i-- > 0;) {
    Part& part = field.parts_[i];
    part.ruled_m = ruled_m[part.group];
    part.reach_m = part.ruled_m + (blends_m[part.group] += part.blend_m);
    field.balls_[i].radius_m += part.reach_m + kRounding_m;
  }
  return field;
}

}  // namespace needlelab
