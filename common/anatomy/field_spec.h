/// A patient's anatomy as plain values, as written by its author: shapes in groups, and ordered rules that
/// say which structure lies where. SI, in the author's frame L.
#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <variant>
#include <vector>

#include "common/base/result.h"
#include "common/haptics/geometry.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

// Fixed capacities of a field. They bound the time of a march and the memory of a compiled field.

inline constexpr std::size_t kMaxFieldGroups = 32;
inline constexpr std::size_t kMaxFieldParts = 256;  ///< a tube of n points counts as n − 1
inline constexpr std::size_t kMaxFieldRules = 64;
inline constexpr std::size_t kMaxFieldStructures = 32;  ///< the layers of a scene
inline constexpr std::size_t kMaxRuleClips = 3;

/// The greatest change of a capsule's or a tube's radius per length.
inline constexpr double kMaxSlope = 0.5;

/// All points within a radius of the segment a-b; the radius changes linearly from a to b, by at most
/// kMaxSlope.
struct CapsulePart {
  Vec3 a_m, b_m;
  double radius_a_m = 0, radius_b_m = 0;  ///< (0, 1]
};
/// The radii along its own axes x, y, z. `x_axis` and `y_axis` have any length > 0 and need not be exactly
/// perpendicular: y is turned within their plane.
struct EllipsoidPart {
  Vec3 center_m;
  Vec3 radii_m;  ///< each (0, 1], the greatest at most 20 times the least
  Vec3 x_axis{1, 0, 0}, y_axis{0, 1, 0};
};
/// The half-space behind `point_m`; `normal` (any length > 0) points out of it.
struct HalfSpacePart {
  Vec3 point_m;
  Vec3 normal;
};
/// A tube along a line of 2 to 64 points, with a radius at each.
struct TubePart {
  struct Point {
    Vec3 at_m;
    double radius_m = 0;  ///< (0, 1]
  };
  std::vector<Point> points;
};

struct FieldPart {
  std::variant<CapsulePart, EllipsoidPart, HalfSpacePart, TubePart> shape;
  /// The part flows into the parts before it over this distance, [0, 0.1]; 0: a sharp edge.
  double blend_m = 0;
};

/// Shapes that together have one signed distance: negative inside.
struct FieldGroup {
  std::string id;
  std::vector<FieldPart> parts;
};

/// The points whose signed distance from a group is in [from, to).
struct FieldRange {
  std::string group;
  double from_m = -std::numeric_limits<double>::infinity();
  double to_m = std::numeric_limits<double>::infinity();
};

/// Points within the range, and within each of the clips, are of the structure, unless an earlier rule took
/// them.
struct FieldRule {
  FieldRange range;
  std::vector<FieldRange> clips;
  std::string structure;
};

/// A thing with a name. `layer` is how it feels; its thickness has no meaning here.
struct FieldStructure {
  std::string id;
  std::string name;
  LayerSpec layer;
};

struct FieldSpec {
  std::vector<FieldGroup> groups;
  std::vector<FieldStructure> structures;
  std::vector<FieldRule> rules;  ///< the first that holds decides
  std::string skin;              ///< the group whose inside is the patient
  std::string rest;              ///< the structure of points in the patient that no rule takes
};

/// Returns the first fault as kInvalidInput, with path, value and range, as `groups[2].parts[0].a_m.x: …`;
/// success if `Field` can be made from it.
Status checkField(const FieldSpec& spec);

}  // namespace needlelab
