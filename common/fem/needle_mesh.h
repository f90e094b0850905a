/// Computes the compliance of a scene at its needle: mesh, assembly, factorisation, one solve per station.
/// Not on the haptic thread: takes seconds, not microseconds.
#pragma once

#include <cstddef>
#include <memory>

#include "common/base/result.h"
#include "common/haptics/models/fem_needle.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// r₀ of a scene without a diameter: half of 0.8 mm, the outer diameter of a 21G needle.
inline constexpr double kNeedleRadius_m = 0.4e-3;
/// Default number of stations of the live needle.
inline constexpr int kDefaultStations = 60;

/// Times to solve one right-hand side, each for a different station, over half a second or 1,000 solves: the
/// cost of a live step without the compliance.
struct SolveTimes {
  double p50_s = 0, p99_s = 0;  ///< medians over five consecutive runs; p99 is at least p50
  double all_s = 0;             ///< for all solves together; not part of a mesh's cost
  std::size_t solves = 0;
};

/// The options of a mesh. The trajectory is the surface normal at the entry; the tissue is a half-space of
/// layers (the limb's curvature is ignored) with the elasticity of `spec.fem.layers`.
struct NeedleMeshOptions {
  int nodes = 10'000;               ///< approximate; thin layers can add nodes
  int stations = kDefaultStations;  ///< 1-kMaxNeedleStations
  double radius_m =
      0;  ///< r₀; 0: half of the scene's needle diameter, or kNeedleRadius_m if the scene has none
  /// The far, held boundary: half-width, and depth below the path, in multiples of the path's length. At 16,
  /// the needle's stiffness is within 1 % of that at 32.
  double half_width_per_length = 16.0;
  SolveTimes* time_solves = nullptr;  ///< if set, solves are timed into it; must outlive the call
};

/// Errors: kInvalidInput (fem section missing or out of range, with the field's path), kFailed when the
/// factorisation fails.
Result<std::shared_ptr<const NeedleCompliance>> precomputeCompliance(const SceneSpec& spec,
                                                                     const NeedleMeshOptions& options);
/// Computes the compliance with the scene's own `fem.nodes` if the scene's model is FEM and it has no
/// compliance yet; does not change any other scene. Station and needlelab-sim call this before `compile`.
Status addCompliance(SceneSpec& spec);

}  // namespace needlelab
