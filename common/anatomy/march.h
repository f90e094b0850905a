/// From a field to the layers that a straight needle meets.
#pragma once

#include <optional>

#include "common/anatomy/field.h"

namespace needlelab {

struct MarchOptions {
  double reach_m = 0.1;  ///< how far to march, (0, 1]: the needle's length
  /// The march advances by the field's clearance, but by this at least: a layer thinner than this can be
  /// missed.
  double min_step_m = 1e-4;
  /// Layers thinner than this go to the layer before: a needle does not feel a sliver below half its
  /// diameter.
  double min_layer_m = 0.35e-3;
  AtBone at_bone = AtBone::kEnds;
};

/// Boundaries are found to this.
inline constexpr double kBoundary_m = 1e-7;

/// Marches from a point on the skin along the unit vector `axis`, by sphere tracing (Hart 1996): no step is
/// longer than the field's clearance, and a change of structure is narrowed down to kBoundary_m. Two layers
/// of one structure are one, if a sliver between them was dropped. Does not allocate; thread: any.
LayerStack march(const Field& field, Vec3 entry_m, Vec3 axis, const MarchOptions& options) noexcept;

/// The place along a line where it enters the skin, from a point outside; nothing within `reach_m`, or from a
/// point inside.
std::optional<double> findEntry(const Field& field, Vec3 from_m, Vec3 axis, double reach_m) noexcept;

}  // namespace needlelab
