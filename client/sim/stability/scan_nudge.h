/// What "stable" means in the scan of stiffness, said once: press on the tissue, nudge the needle, see
/// whether the swing dies out.
#pragma once

#include "client/sim/stability/case_file.h"
#include "client/sim/stability/force_source.h"
#include "client/sim/stability/plant.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// The hand presses into the tissue until wall and hand hold each other at `press_N`, and rests; then a short
/// tap gives the handle `nudge_mps`; then it is watched. The scene's surface is z = 0, its tissue below.
struct NudgeOptions {
  double press_N = 2;       ///< below the cutting force: an elastic wall holds it
  double settle_s = 1;      ///< rest before the tap
  double nudge_mps = 0.01;  ///< so small that the wall stays in its elastic part
  double watch_s = 3;
};

/// The options as they stand in a case's entry: press_n, settle_s, nudge_m_s, watch_s.
NudgeOptions nudgeOptionsOf(CaseEntry& entry);

/// What came of a nudge. A swing is how the needle moves along z (not what the encoders say of it) about its
/// own mean of 0.3 s (a wall that relaxes lets the needle creep on, and that is no swing), as the
/// peak-to-peak of the sine that has the same RMS.
struct NudgeOutcome {
  bool finite = true;
  Fault fault = Fault::kNone;
  double swing_first_m = 0;   ///< in the first third of the watch
  double swing_middle_m = 0;  ///< in the fifth before the middle
  double swing_end_m = 0;     ///< in a fifth near the end
  double force_end_N = 0;     ///< peak-to-peak of the force in that fifth
  double wall_N_per_m = 0;    ///< force over depth in the watch, by least squares: the stiffness that it felt
  bool stable = false;        ///< by `isStable`
};

/// Swings up to this many encoder steps peak-to-peak are what the encoder cannot tell from rest: a wall
/// without friction never comes to a full rest in them.
inline constexpr double kRestEncoderSteps = 4;

/// Stable: finite, no fault, and at the end of the watch the swing is within `kRestEncoderSteps` or has
/// become smaller by a twentieth since the middle. What swings on with one and the same amplitude is not
/// stable.
bool isStable(const NudgeOutcome& outcome, double encoder_step_m);

struct NudgeRun {
  PlantRun run;
  TimeWindow watch;
  NudgeOutcome outcome;
};
/// `stiffness_N_per_m`: of the scene's wall, for the depth to press to. Errors: of the factory and the plant.
Result<NudgeRun> nudge(const ForceSourceFactory& source, const SceneSpec& scene, double stiffness_N_per_m,
                       const PlantOptions& plant, const NudgeOptions& options);

}  // namespace needlelab
