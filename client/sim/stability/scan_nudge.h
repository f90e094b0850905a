/// Defines "stable" for the stiffness scan: press on the tissue, nudge the needle, and check that the swing
/// dies out.
#pragma once

#include <string_view>

#include "client/sim/stability/case_file.h"
#include "client/sim/stability/loop/measures.h"
#include "client/sim/stability/loop/plant.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// The hand presses into the tissue until wall and hand balance at `press_N`, and rests. Then a short tap
/// gives the handle `nudge_mps`, and the run is observed. The scene's surface is z = 0 with the tissue below.
struct NudgeOptions {
  double press_N = 2;       ///< below the cutting force, so an elastic wall holds it
  double settle_s = 1;      ///< rest before the tap
  double nudge_mps = 0.01;  ///< small enough that the wall stays elastic
  double watch_s = 3;
};

/// Reads the options from a case's entry: press_n, settle_s, nudge_m_s, watch_s.
NudgeOptions nudgeOptionsOf(CaseEntry& entry);

/// The outcome of a nudge. A swing is the needle's true motion along z (not the encoder readings) about its
/// own 0.3 s mean, as the peak-to-peak of a sine with the same RMS. The needle may creep in a relaxing wall;
/// creep is not a swing.
struct NudgeOutcome {
  bool finite = true;
  Fault fault = Fault::kNone;
  double swing_middle_m = 0;  ///< in the fifth before the middle
  double swing_end_m = 0;     ///< in a fifth near the end
  double wall_N_per_m = 0;    ///< least-squares force over depth while observed: the stiffness felt
  bool stable = false;        ///< from `isStable`
};

/// The encoder cannot distinguish swings of up to this many encoder steps (peak-to-peak) from rest: a wall
/// without friction never comes to complete rest within them.
inline constexpr double kRestEncoderSteps = 4;

/// Stable: finite, no fault, and at the end of the observation the swing is within `kRestEncoderSteps` or has
/// shrunk by a twentieth since the middle. A swing of constant amplitude is not stable.
bool isStable(const NudgeOutcome& outcome, double encoder_step_m);

struct NudgeRun {
  PlantRun run;
  TimeWindow watch;
  NudgeOutcome outcome;
};
/// `stiffness_N_per_m`: of the scene's wall, to find the depth to press to. Errors: of the factory and the
/// plant.
Result<NudgeRun> nudge(const ForceSourceFactory& source, const SceneSpec& scene, double stiffness_N_per_m,
                       const PlantOptions& plant, const NudgeOptions& options);

inline constexpr double kMaxProfileStiffness_N_per_m = 10'000;  ///< maximum in a profile
                                                                ///< (db/samples/README.md)

/// "K" is K_t of the tracking wall; every other model derives its stiffness from it by likeForLike. FEM has
/// no such number: its E and compliance are scaled until a nudge feels K.
class ScannedModel {
 public:
  /// `scene` is the wall's. For FEM the constructor solves the mesh and measures the felt stiffness by nudges
  /// with `plant` and `options`; kFailed if no stiffness is felt. Other errors: those of `compile`.
  static Result<ScannedModel> prepare(const SceneSpec& scene, AxialModel model, const PlantOptions& plant,
                                      const NudgeOptions& options);

  [[nodiscard]] SceneSpec with(double stiffness_N_per_m) const;
  [[nodiscard]] AxialModel model() const { return scene_.axial_model; }
  /// The steepest slope of the model's force over the speed: B of VOIGT. In N·s/m.
  [[nodiscard]] double damping_Ns_per_m() const { return damping_Ns_per_m_; }

 private:
  explicit ScannedModel(SceneSpec wall, SceneSpec scene) : wall_(std::move(wall)), scene_(std::move(scene)) {}
  SceneSpec wall_, scene_;
  double damping_Ns_per_m_ = 0;
  double felt_N_per_m_ = 0;  // FEM: felt stiffness of the unscaled `scene_`
};

}  // namespace needlelab
