/// A scene met by a straight needle that follows a given depth over time: what the fitted models are run
/// with. The real engine (compile and step), not a formula.
#pragma once

#include <cstdint>
#include <vector>

#include "common/base/result.h"
#include "common/haptics/engine.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// Depth of the tip below the scene's surface at each tick (negative: outside), in m. The needle points along
/// the motion; the scene's limb must be the plane z = 0 with normal +z.
struct StraightGesture {
  double rate_hz = 1000;
  std::vector<double> depth_m;
};

/// The resisting force at each tick in N: positive pushes the needle out, as recordings have it.
struct AxialRun {
  std::vector<double> force_N;
  std::vector<std::uint32_t> flags;  ///< StepFlag of each tick
};

/// Errors: those of `compile`.
Result<AxialRun> runStraight(const SceneSpec& scene, const StraightGesture& gesture);
/// The same with a scene that is compiled already; for many runs. Resizes `run`.
void runStraight(const SceneModel& model, const StraightGesture& gesture, AxialRun& run);

/// From `from_m` to `to_m` at `speed_mps`, the first tick at `from_m`.
StraightGesture constantSpeed(double from_m, double to_m, double speed_mps, double rate_hz);

/// The force at a fractional tick, linear between ticks, held at both ends.
double forceAtTick(const AxialRun& run, double tick);

/// A plane at z = 0, no effect listed, layers empty, sum capped at 50 N only: what fitted scenes begin with.
/// Stops at 1 mm/s, since recordings move at 3 mm/s, which is the usual stop speed.
SceneSpec fittedSceneBase();

}  // namespace needlelab
