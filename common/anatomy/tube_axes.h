/// The coordinates of tubes: along the axis, from it, about it. For drawing.
#pragma once

#include <optional>
#include <vector>

#include "common/anatomy/field_spec.h"

namespace needlelab {

/// A point in a tube's own coordinates.
struct TubePlace {
  double along_m = 0;   ///< length of the axis from its beginning to its point nearest to this one
  double radial_m = 0;  ///< distance from there
  /// About the axis, from −π to π, right-handed as seen along it. Its 0 is perpendicular to the axis,
  /// as near as can be to that frame axis which is most across the tube's beginning, and follows bends
  /// without turning about the axis.
  double angle_rad = 0;
};

/// The axes of a group's tubes. Capsules in a row, each from the end of its predecessor, are one tube.
/// Immutable; any number of threads may ask.
class TubeAxes {
 public:
  /// nullopt: the group has parts of other shapes, or balls alone.
  static std::optional<TubeAxes> of(const FieldGroup& group);
  /// In the tube whose surface is nearest to the point.
  [[nodiscard]] TubePlace at(Vec3 p_m) const noexcept;

 private:
  struct Piece {
    Vec3 from_m, axis, zero;  // unit vectors: along the piece, and where the angle is 0
    double length_m, along_m, radius_m, growth;
  };
  void add(Vec3 a_m, Vec3 b_m, double radius_a_m, double radius_b_m);

  std::vector<Piece> pieces_;
};

}  // namespace needlelab
