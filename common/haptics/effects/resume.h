/// Goes on from what a recording says of a tick. A recording rounds poses and walls to a micrometre, and near
/// a threshold that decides: an engine that steps the stored poses alone begins a stop or ruptures a membrane
/// that the station's did not, and feels it for seconds. What the station decided is stored with each tick:
/// contact, layer, phase, rupture, the wall's place. The engine takes these, and computes the rest.
#pragma once

#include <cmath>
#include <cstdint>

#include "common/haptics/engine.h"
#include "common/haptics/force_gate.h"

namespace needlelab {

/// What a recording says of a tick that the station stepped.
struct StoredTick {
  Vec3 force_W_N;           ///< on the hand, after the gate
  Vec3 p_wall_W_m;          ///< NaN: none
  std::int32_t layer = -1;  ///< −1 when free
  Phase phase = Phase::kFree;
  std::uint32_t flags = 0;  ///< StepFlag | GateFlag
  /// False where the gate made another force of the engine's.
  [[nodiscard]] bool hasEnginesForce() const {
    return (flags &
            (kGatePeakLimited | kGateThermalLimited | kGateSlewLimited | kGateStartRamp | kGateFaulted)) == 0;
  }
};

/// `sample`: a GestureSample (common/gesture), which this library does not include.
template <class Sample>
StoredTick storedTickOf(const Sample& sample) {
  StoredTick stored;
  stored.force_W_N = {sample.force_W_N[0], sample.force_W_N[1], sample.force_W_N[2]};
  stored.p_wall_W_m = {sample.wall_W_m[0], sample.wall_W_m[1], sample.wall_W_m[2]};
  stored.layer = sample.layer;
  if (sample.phase <= static_cast<std::uint8_t>(Phase::kWithdrawing))
    stored.phase = static_cast<Phase>(sample.phase);
  stored.flags = sample.flags;
  return stored;
}

/// What rounded poses explain, in N: some steps of stiff springs. Together with the rounding of a stored
/// force (1 mN) it is 0.02 N, which a hand hardly notices.
inline constexpr double kRoundingExplains_N = 0.019;

/// What a step's result differs by from the stored tick.
struct StoredDifference {
  bool elsewhere = false;  ///< contact or layer differ, by more than the rounding of a pose
  double force_N = 0;      ///< |force − stored force|; 0 where the gate changed the force
  [[nodiscard]] bool isReal() const { return elsewhere || force_N > kRoundingExplains_N; }
};

/// Compares a step's report with the stored tick.
StoredDifference differenceFrom(const StoredTick& stored, const StepReport& report);

/// Steps one tick as the station did: takes the pose within its rounding that lies in the stored layer,
/// steps, and takes stored ruptures, wall and phase where the engine's own differ by more than the rounding.
/// State and report are then as if the engine had decided so itself. With samples that are not rounded it
/// gives the bits of `step`. Returns what is left of the difference. Thread: as `step`; not for the haptic
/// thread.
StoredDifference stepAsStored(const SceneModel& model, const TipSample& sample, const StoredTick& stored,
                              SimState& state, StepReport& report);

}  // namespace needlelab
