#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "common/anatomy/field_spec.h"
#include "common/haptics/spec_checker.h"

namespace needlelab {
namespace {

constexpr NumberRange kRadius{0, 1, true};
constexpr NumberRange kBlend{0, 0.1};
constexpr NumberRange kBound{-1, 1};
constexpr double kMinLength_m = 1e-6;    // of a direction or a tube's piece
constexpr double kMaxRatioOfRadii = 20;  // of an ellipsoid
constexpr double kMinSineOfAxes = 1e-3;  // between an ellipsoid's axes
constexpr std::size_t kMaxTubePoints = 64;

/// Checks a field part by part; all paths begin at the field.
class FieldChecker {
 public:
  explicit FieldChecker(const FieldSpec& spec) : spec_(spec) {}

  Status check() {
    checkCount("groups", spec_.groups.size(), 1, kMaxFieldGroups);
    checkCount("structures", spec_.structures.size(), 1, kMaxFieldStructures);
    checkCount("rules", spec_.rules.size(), 0, kMaxFieldRules);
    checkIds("groups", spec_.groups);
    checkIds("structures", spec_.structures);
    std::size_t parts = 0;
    for (std::size_t i = 0; i < spec_.groups.size(); ++i) {
      const FieldGroup& group = spec_.groups[i];
      checker_.require(!group.parts.empty(), fmt::format("groups[{}].parts", i),
                       "a group needs at least one part");
      for (std::size_t k = 0; k < group.parts.size(); ++k) {
        checker_.enter(fmt::format("groups[{}].parts[{}].", i, k));
        parts += checkPart(group.parts[k]);
        checker_.enter({});
      }
    }
    checkCount("groups", parts, 1, kMaxFieldParts, "parts");
    checkReference("skin", spec_.skin, spec_.groups);
    checkReference("rest", spec_.rest, spec_.structures);
    for (std::size_t i = 0; i < spec_.rules.size(); ++i) {
      const FieldRule& rule = spec_.rules[i];
      const std::string path = fmt::format("rules[{}]", i);
      checkRange(path + ".", rule.range);
      checkCount(path + ".clips", rule.clips.size(), 0, kMaxRuleClips);
      for (std::size_t k = 0; k < rule.clips.size(); ++k)
        checkRange(fmt::format("{}.clips[{}].", path, k), rule.clips[k]);
      checkReference(path + ".structure", rule.structure, spec_.structures);
    }
    return checker_.take();
  }

 private:
  void checkCount(const std::string& path, std::size_t count, std::size_t least, std::size_t most,
                  const char* what = "entries") {
    checker_.require(count >= least && count <= most, path,
                     fmt::format("has {} {}; {} to {} are allowed", count, what, least, most));
  }

  template <class Named>
  void checkIds(const char* list, const std::vector<Named>& named) {
    std::set<std::string> seen;
    for (std::size_t i = 0; i < named.size(); ++i) {
      const std::string path = fmt::format("{}[{}].id", list, i);
      checker_.require(!named[i].id.empty(), path, "is empty");
      checker_.require(seen.insert(named[i].id).second, path, fmt::format("'{}' is used twice", named[i].id));
    }
  }

  template <class Named>
  void checkReference(const std::string& path, const std::string& id, const std::vector<Named>& named) {
    const bool is_known =
        std::any_of(named.begin(), named.end(), [&](const Named& one) { return one.id == id; });
    if (is_known) return;
    std::string all;
    for (const Named& one : named) all += (all.empty() ? "" : ", ") + one.id;
    checker_.require(false, path, fmt::format("'{}' is not one of: {}", id, all));
  }

  void checkRange(const std::string& path, const FieldRange& range) {
    checkReference(path + "group", range.group, spec_.groups);
    if (!std::isinf(range.from_m)) checker_.number(path + "from_m", range.from_m, kBound);
    if (!std::isinf(range.to_m)) checker_.number(path + "to_m", range.to_m, kBound);
    checker_.require(
        range.from_m < range.to_m, path + "to_m",
        fmt::format("{} is not greater than from_m, {}", numberText(range.to_m), numberText(range.from_m)));
  }

  void direction(const char* field, Vec3 value) {
    checker_.point(field, value);
    checker_.require(norm(value) >= kMinLength_m, field, "has no direction: its length is 0");
  }

  void slope(const std::string& field, double from_m, double to_m, double length_m) {
    checker_.require(
        std::fabs(to_m - from_m) <= kMaxSlope * length_m, field,
        fmt::format("the radius changes from {} to {} m over {} m: at most half the length is allowed",
                    numberText(from_m), numberText(to_m), numberText(length_m)));
  }

  /// Returns the number of compiled parts.
  std::size_t checkPart(const FieldPart& part) {
    checker_.number("blend_m", part.blend_m, kBlend);
    if (const auto* const capsule = std::get_if<CapsulePart>(&part.shape)) {
      checker_.point("capsule.a_m", capsule->a_m);
      checker_.point("capsule.b_m", capsule->b_m);
      checker_.number("capsule.radius_a_m", capsule->radius_a_m, kRadius);
      checker_.number("capsule.radius_b_m", capsule->radius_b_m, kRadius);
      slope("capsule.radius_b_m", capsule->radius_a_m, capsule->radius_b_m,
            norm(capsule->b_m - capsule->a_m));
      return 1;
    }
    if (const auto* const ellipsoid = std::get_if<EllipsoidPart>(&part.shape)) {
      checkEllipsoid(*ellipsoid);
      return 1;
    }
    if (const auto* const half_space = std::get_if<HalfSpacePart>(&part.shape)) {
      checker_.point("half_space.point_m", half_space->point_m);
      direction("half_space.normal", half_space->normal);
      return 1;
    }
    const std::vector<TubePart::Point>& points = std::get<TubePart>(part.shape).points;
    checkCount("tube.points", points.size(), 2, kMaxTubePoints);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const std::string path = fmt::format("tube.points[{}].", i);
      checker_.point(path + "at_m", points[i].at_m);
      checker_.number(path + "radius_m", points[i].radius_m, kRadius);
      if (i == 0) continue;
      const double length_m = norm(points[i].at_m - points[i - 1].at_m);
      checker_.require(length_m >= kMinLength_m, path + "at_m", "is the same point as the one before");
      slope(path + "radius_m", points[i - 1].radius_m, points[i].radius_m, length_m);
    }
    return points.size() - 1;
  }

  void checkEllipsoid(const EllipsoidPart& ellipsoid) {
    checker_.point("ellipsoid.center_m", ellipsoid.center_m);
    checker_.number("ellipsoid.radii_m.x", ellipsoid.radii_m.x, kRadius);
    checker_.number("ellipsoid.radii_m.y", ellipsoid.radii_m.y, kRadius);
    checker_.number("ellipsoid.radii_m.z", ellipsoid.radii_m.z, kRadius);
    const auto [least, most] = std::minmax({ellipsoid.radii_m.x, ellipsoid.radii_m.y, ellipsoid.radii_m.z});
    checker_.require(most <= kMaxRatioOfRadii * least, "ellipsoid.radii_m",
                     fmt::format("the greatest, {}, is more than {} times the least, {}: use a capsule",
                                 numberText(most), kMaxRatioOfRadii, numberText(least)));
    direction("ellipsoid.x_axis", ellipsoid.x_axis);
    direction("ellipsoid.y_axis", ellipsoid.y_axis);
    checker_.require(norm(cross(ellipsoid.x_axis, ellipsoid.y_axis)) >=
                         kMinSineOfAxes * norm(ellipsoid.x_axis) * norm(ellipsoid.y_axis),
                     "ellipsoid.y_axis", "is parallel to x_axis");
  }

  const FieldSpec& spec_;
  SpecChecker checker_;
};

}  // namespace

Status checkField(const FieldSpec& spec) {
  return FieldChecker(spec).check();
}

}  // namespace needlelab
