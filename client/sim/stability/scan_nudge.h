/// Defines "stable" for the stiffness scan: press on the tissue, nudge the needle, and check that the swing
/// dies out.
#pragma once

#include <string_view>

#include "client/sim/stability/case_file.h"
#include "client/sim/stability/plant.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// The hand presses into the tissue until wall and hand balance at `press_N`, and rests. Then a short tap
/// gives the handle `nudge_mps`, and the run is watched. The scene's surface is z = 0, its tissue below.
struct NudgeOptions {
  double press_N = 2;       ///< below the cutting force: an elastic wall holds it
  double settle_s = 1;      ///< rest before the tap
  double nudge_mps = 0.01;  ///< so small that the wall stays in its elastic part
  double watch_s = 3;
};

/// Reads the options from a case's entry: press_n, settle_s, nudge_m_s, watch_s.
NudgeOptions nudgeOptionsOf(CaseEntry& entry);

/// The outcome of a nudge. A swing is the needle's true motion along z (not the encoder readings) about its
/// own mean of 0.3 s, as the peak-to-peak of a sine with the same RMS. A relaxing wall lets the needle creep
/// on; creep is not a swing.
struct NudgeOutcome {
  bool finite = true;
  Fault fault = Fault::kNone;
  double swing_middle_m = 0;  ///< in the fifth before the middle
  double swing_end_m = 0;     ///< in a fifth near the end
  double force_end_N = 0;     ///< peak-to-peak of the force in that fifth
  double wall_N_per_m = 0;    ///< force over depth in the watch, by least squares: the stiffness that it felt
  bool stable = false;        ///< by `isStable`
};

/// The encoder cannot tell swings up to this many encoder steps (peak-to-peak) from rest: a wall without
/// friction never comes to a full rest within them.
inline constexpr double kRestEncoderSteps = 4;

/// Stable: finite, no fault, and at the end of the watch the swing is within `kRestEncoderSteps` or has
/// become smaller by a twentieth since the middle. A swing with constant amplitude is not stable.
bool isStable(const NudgeOutcome& outcome, double encoder_step_m);

struct NudgeRun {
  PlantRun run;
  TimeWindow watch;
  NudgeOutcome outcome;
};
/// `stiffness_N_per_m`: of the scene's wall, for the depth to press to. Errors: of the factory and the plant.
Result<NudgeRun> nudge(const ForceSourceFactory& source, const SceneSpec& scene, double stiffness_N_per_m,
                       const PlantOptions& plant, const NudgeOptions& options);

/// Colgate and Schenkel (1997): a wall K, sampled and held, is passive when b > K T/2; with d further ticks
/// of delay b > K T (½ + d). With the device's damping alone: passive, so stable whatever the hand. With the
/// hand's added: stable with that hand (coupled stability). In N/m.
double passiveStiffnessLimit(double damping_Ns_per_m, double period_s, double delay_ticks);

/// Abbott and Okamura (2005), Diolaiti et al. (2006): with encoder step Δ and Coulomb friction f_c a wall is
/// passive, down to the smallest cycle, when K ≤ min(2b/T, 2f_c/Δ). Infinite second part where Δ is 0. In
/// N/m.
double quantisedStiffnessLimit(double damping_Ns_per_m, double period_s, double dry_friction_N,
                               double encoder_step_m);

/// The loop of a wall that stays in contact: handle and hand are a mass on a spring and a damper, the wall is
/// K + B (1 − z⁻¹)/T, sampled and held, d ticks late.
struct LinearLoop {
  double mass_kg = 0.35;
  double damping_Ns_per_m = 3.5;     ///< of device and hand
  double stiffness_N_per_m = 300;    ///< of the hand, more than 0
  double period_s = 1e-3;            ///< T
  unsigned delay_ticks = 1;          ///< d
  double wall_damping_Ns_per_m = 0;  ///< B, by a one-tick difference
};

/// The smallest K at which the linear loop swings without end, from its pulse transfer function (no small-KT
/// approximation). In N/m; infinite where there is none.
double sampledStiffnessLimit(const LinearLoop& loop);

inline constexpr double kMaxProfileStiffness_N_per_m = 10'000;  ///< of a profile (db/samples/README.md)

/// What "K" is: K_t of the tracking wall and of the models that it renders (STATISTICAL, and PRECOMPUTED,
/// where the table rises with K_t too), the section's stiffness of DIRECT, VOIGT and GOD_OBJECT, the
/// stiffness up to puncture of FIRST_ORDER, OKAMURA and DAHL: all by likeForLike from K_t. FEM has no such
/// number: its E and its compliance are scaled until a nudge feels K.
class ScannedModel {
 public:
  /// `scene` is the wall's. For FEM the constructor solves the mesh and measures the felt stiffness by nudges
  /// with `plant` and `options`; kFailed when no stiffness is felt.
  static Result<ScannedModel> prepare(const SceneSpec& scene, AxialModel model, const PlantOptions& plant,
                                      const NudgeOptions& options);

  [[nodiscard]] SceneSpec with(double stiffness_N_per_m) const;
  [[nodiscard]] AxialModel model() const { return scene_.axial_model; }
  /// B of VOIGT, 0 of the others. In N·s/m.
  [[nodiscard]] double damping_Ns_per_m() const;

 private:
  explicit ScannedModel(SceneSpec wall, SceneSpec scene) : wall_(std::move(wall)), scene_(std::move(scene)) {}
  SceneSpec wall_, scene_;
  double felt_N_per_m_ = 0;  // FEM: of `scene_` as it is
};

/// The parameter that is K of a model, for a table's caption.
std::string_view stiffnessParameter(AxialModel model);

}  // namespace needlelab
