/// From a scene to the compliance that its needle feels: mesh, assembly, factor, one solve per station.
/// Off the haptic thread: seconds, not microseconds.
#pragma once

#include <memory>

#include "common/base/result.h"
#include "common/haptics/models/fem_needle.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// r₀ where a scene does not say: half of 0.8 mm, the outer diameter of a 21G needle.
inline constexpr double kNeedleRadius_m = 0.4e-3;
/// Stations of the live needle where the caller asks for none.
inline constexpr int kDefaultStations = 60;

/// The options of a mesh. The trajectory is the surface normal at the entry, the tissue a half-space of
/// layers (the limb's curvature is not seen), `spec.fem.layers` its elasticity.
struct NeedleMeshOptions {
  int nodes = 10'000;               ///< about so many; layers that are thin can make it more
  int stations = kDefaultStations;  ///< 1-kMaxNeedleStations
  double radius_m = 0;  ///< r₀; 0: half of the scene's needle, kNeedleRadius_m where it has no diameter
  /// The far boundary, held: half-width, and depth below the path, in lengths of the path. At 16 the needle
  /// is within 1 % of as stiff as at 32.
  double half_width_per_length = 16.0;
};

/// Errors: kInvalidInput (fem section missing or out of range, with the field's path), kFailed when the
/// factorisation fails.
Result<std::shared_ptr<const NeedleCompliance>> precomputeCompliance(const SceneSpec& spec,
                                                                     const NeedleMeshOptions& options);
/// With the scene's own `fem.nodes`, for a scene whose model is FEM and which has no compliance yet; any
/// other is left alone. What station and needlelab-sim call before `compile`.
Status addCompliance(SceneSpec& spec);

}  // namespace needlelab
