/// Continues the engine from a recorded tick. A recording rounds poses and walls to a micrometre, which
/// matters near a threshold: an engine that only steps the stored poses may begin a stop or rupture a
/// membrane where the station did not, with an effect for seconds. Each tick therefore stores the station's
/// decisions: contact, layer, phase, rupture, the wall's place. The engine takes these and computes the rest.
#pragma once

#include <cmath>
#include <cstdint>

#include "common/haptics/engine.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {

/// The stored data of a tick that the station stepped.
struct StoredTick {
  Vec3 force_W_N;           ///< on the hand, after the gate
  Vec3 p_wall_W_m;          ///< NaN: none
  std::int32_t layer = -1;  ///< −1 when free
  Phase phase = Phase::kFree;
  std::uint32_t flags = 0;  ///< StepFlag | GateFlag
  /// False if the gate changed the engine's force.
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

/// The force difference that rounded poses explain, in N: a few rounding steps on stiff springs. Together
/// with the rounding of a stored force (1 mN) it is 0.02 N, which a hand hardly notices.
inline constexpr double kRoundingExplains_N = 0.019;

/// How a step's result differs from the stored tick.
struct StoredDifference {
  bool elsewhere = false;  ///< contact or layer differ by more than a pose's rounding explains
  double force_N = 0;      ///< |force − stored force|; 0 where the gate changed the force
  [[nodiscard]] bool isReal() const { return elsewhere || force_N > kRoundingExplains_N; }
};

/// Compares a step's report with the stored tick.
StoredDifference differenceFrom(const StoredTick& stored, const StepReport& report);

/// Steps one tick as the station did: takes the pose within its rounding that lies in the stored layer,
/// steps, and takes stored ruptures, wall and phase where the engine's own differ by more than the rounding.
/// State and report are then as if the engine itself had made these decisions. For samples that are not
/// rounded, the results equal those of `step` bit for bit. Returns the remaining difference. Thread: as
/// `step`; not for the haptic thread.
StoredDifference stepAsStored(const SceneModel& model, const TipSample& sample, const StoredTick& stored,
                              SimState& state, StepReport& report);

}  // namespace needlelab
