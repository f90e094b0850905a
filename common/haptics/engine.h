/// The haptic engine: one tick of FORCE_MODEL.md. No I/O, clock, heap, lock or exception; same inputs give
/// the same bits.
#pragma once

#include <array>
#include <cstdint>

#include "common/haptics/scene_model.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// The tip's pose at one tick, in W. Finite, |q| = 1 (the gate rejects others before the engine sees them).
struct TipSample {
  Vec3 p_WT_m;
  Quat q_WT;
};

/// Events of a tick that explain its forces: a force step is allowed if one of the releases is set.
enum StepFlag : std::uint32_t {
  kFlagEntry = 1u << 0,        ///< an insertion began
  kFlagExit = 1u << 1,         ///< release: the tip left the tissue
  kFlagLayerChange = 1u << 2,  ///< release: the tip's layer differs from the previous tick's; with FEM
                               ///< also: the cut runs ahead, as on entering a softer layer
  kFlagRupture = 1u << 3,      ///< release: a membrane ruptured
  kFlagTurn = 1u << 4,         ///< u turned (change of trajectory)
  kFlagClampCapped = 1u << 5,  ///< the clamping force is at its maximum
  kFlagForceCapped = 1u << 6,  ///< the sum was limited to max_force_N
  kFlagTorque = 1u << 7,       ///< the orientation limit exerts torque
  kFlagNotStepped = 1u << 8,   ///< the sample was not finite: state unchanged, no force
  kFlagStartedInside =
      1u << 9,  ///< the tip is in the tissue, or its cap on the skin, and never was off it: no force
  kFlagBeyondNeedle = 1u << 10,  ///< inserted further than the needle is long
  kFlagFlatEntry = 1u << 11,     ///< with kFlagEntry: the needle lies on the skin, within 10 degrees
  kFlagNewPath = 1u << 12,       ///< a body: from this tick on, the layers are those asked for 5 ms ago
  kFlagKeptPath = 1u << 13,      ///< a body: they came too late: the path was kept
  kFlagCapped = 1u << 14,        ///< PALPATION: the needle is capped: it feels, and enters nothing
  kFlagSkipped = 1u << 15,  ///< a body, with kFlagNewPath: the tip had passed a layer before its path came
};

/// Output of one tick. Forces act on the user's hand; `*_N` along u are signed (cutting is negative,
/// attracted positive).
struct StepReport {
  Wrench wrench_W;  ///< force on the hand and torque about the tip, in W, before the gate
  Vec3 p_wall_W_m;  ///< P0 + u·w; NaN when free or when no wall is live
  Phase phase = Phase::kFree;
  std::int32_t layer = -1;     ///< −1 when free
  double depth_m = 0;          ///< δ, always
  double insertion_m = 0;      ///< d_t; 0 when free
  double speed_mps = 0;        ///< v along u over the speed window; 0 when free
  double lateral_error_m = 0;  ///< |e|; 0 when free
  double cutting_N = 0, attracted_N = 0, friction_N = 0, puncture_N = 0;  ///< along u, signed
  double clamping_N = 0;                                                  ///< magnitude
  double hub_N = 0;                       ///< magnitude; only with kFlagBeyondNeedle
  double clamping_stiffness_N_per_m = 0;  ///< k of this tick
  std::array<double, kMaxStages>
      stage_N{};            ///< terms of the stages, by `stageOf`; written only for live stages
  std::uint32_t flags = 0;  ///< StepFlag
};

/// Steps one tick. Thread: one at a time per state; the model may be shared. Real-time safe.
void step(const SceneModel& model, const TipSample& sample, SimState& state, StepReport& report) noexcept;

}  // namespace needlelab
