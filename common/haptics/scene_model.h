/// A compiled scene: immutable, shared by all threads, with all precomputed values for a tick.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "common/haptics/scene_spec.h"

namespace needlelab {

struct DepthTable;
struct FemNeedle;
struct ShaftLimits;
struct SimState;
class StatisticalTarget;
struct StepReport;
struct TipSample;
class SceneModel;
/// Δ_cut at the tip, in m, at this depth δ: how far the wall of an axial model can be behind the needle.
/// Real-time safe; may use the state's caches.
using CutReach = double (*)(const SceneModel&, SimState&, double depth_m) noexcept;
/// One tick of a scene's axial model with its live effects.
using StepFunction = void (*)(const SceneModel&, const TipSample&, SimState&, StepReport&) noexcept;
/// One tick of a stage effect. Called only in the tissue, after all other effects: `report` is this tick's
/// report without the stages. Returns the force in W and writes the effect's term into `report.stage_N`. A
/// stage without a term changes the other effects' terms in the report, and returns the change.
using StageFunction = Vec3 (*)(const SceneModel&, const TipSample&, SimState&, StepReport&) noexcept;
/// Returns the tip as felt by the tissue, before a tick: BONE holds it where the needle rests on the bone.
using HoldFunction = TipSample (*)(const SceneModel&, const TipSample&, SimState&) noexcept;

/// One layer, ready for the tick. Depths δ run along the surface normal.
struct CompiledLayer {
  double min_depth_m =
      0;  ///< the layer's top; for the first layer the least positive number, because δ = 0 is outside
  double bottom_m = 0;             ///< the next layer's top; infinite for the last
  double top_m = 0;                ///< half-open [top, bottom)
  double cutting_force_N = 0;      ///< f_cut; 0 if CUTTING is not live
  double cut_stretch_m = 0;        ///< Δ_cut = f_cut/K_t; 0 if CUTTING is not live
  double attracted_stretch_m = 0;  ///< f_att/K_t; 0 if ATTRACTED is not live
  double rejection_stretch_m = 0;  ///< f_rej/K_t
  double lateral_N_per_m2 = 0;
  double friction_N_per_m = 0;
  double wall_stiffness_N_per_m = 0;  ///< K_t
  std::array<double, 6> fill{};       ///< pads to two cache lines, so that a shift of the index finds a layer
};

/// A membrane, ready for the tick; sorted by depth of its layer's top.
struct CompiledMembrane {
  double top_m = 0;
  double k1_N_per_m = 0, k2_N_per_m2 = 0;
  double force_N = 0;
  double slope_at_rupture_N_per_m = 0;  ///< k1 + 2 k2 z at rupture: the steepest slope
};

/// The maximum stiffness of a scene's fixture while u does not turn.
struct FixtureSteepness {
  double across_N_per_m = 0;  ///< in the worst direction: the greatest eigenvalue of the second derivatives
                              ///< of U
  double along_N_per_m = 0;   ///< the second derivative of U along u
};
FixtureSteepness fixtureSteepness(const SceneSpec& spec);

/// What the springs hold after a tick, in J: a loop that gives back no more gives nothing. A spring of force
/// f and stiffness k counts f²/(2k), a saturated torque its way through a right angle, and the tissue's force
/// the way for which a stretched membrane or bone keeps it. Real-time safe.
double heldEnergy_J(const SceneModel& model, const SimState& state, const StepReport& report) noexcept;

/// Stiffnesses along the trajectory, of live effects (FORCE_MODEL.md, "Stiffnesses").
struct AlongStiffness {
  double tissue_N_per_m = 0;    ///< K_t, or the axial model's, and K_f
  double membrane_N_per_m = 0;  ///< the steepest, and the axial model's if that does not rest behind one
  double fixture_N_per_m = 0;
  double hub_N_per_m = 0;    ///< with the tissue's, once it is on the skin
  double alone_N_per_m = 0;  ///< bone, or the cap
  /// The greatest that can act at once.
  [[nodiscard]] double atOnce() const;
};

/// The bones of a body in W; null where it has none. Real-time safe.
struct PlacedBones {
  std::shared_ptr<const Bones> bones;
  Pose X_WL, X_LW;

  [[nodiscard]] double distance(Vec3 p_W_m) const noexcept { return bones->distance(X_LW * p_W_m); }
  [[nodiscard]] Vec3 slope(Vec3 p_W_m) const noexcept { return rotate(X_WL.q, bones->slope(X_LW * p_W_m)); }
  [[nodiscard]] StructureIndex structureAt(Vec3 p_W_m) const noexcept {
    return bones->structureAt(X_LW * p_W_m);
  }
};

/// The skin and the bones about a capped tip, and about the place where its ball rests on the skin, in W;
/// null before a body's first path. Real-time safe.
struct PlacedSurroundings {
  std::shared_ptr<const Surroundings> tip, rest;
  Pose X_WL, X_LW;

  [[nodiscard]] DistanceAt skinAtTip(Vec3 p_W_m) const noexcept { return placed(tip->skin(X_LW * p_W_m)); }
  /// Turned from L to W.
  [[nodiscard]] DistanceAt placed(DistanceAt at) const noexcept {
    return {at.distance_m, rotate(X_WL.q, at.slope)};
  }
};

/// Only `compile` makes one; const afterwards. Copying is cheap enough outside the haptic thread. Thread: any
/// may read.
class SceneModel {
 public:
  double rate_hz = 0;
  double period_s = 0;  ///< T
  std::uint64_t dwell_ticks = 0;
  std::uint64_t rest_ticks = 0;    ///< kRest_s in ticks
  double stop_ticks = 0;           ///< n of eq. 5
  std::uint64_t speed_window = 0;  ///< 100 ms in ticks
  double speed_window_s = 0;       ///< … and in s
  std::uint64_t history_mask = 0;  ///< the ring has 2^n positions, as few as the window allows, to stay in
                                   ///< cache
  double arming_speed_mps = 0;     ///< kArmingSpeeds·v_stop
  double max_stop_step_m = 0;      ///< 1.5·v_stop·T
  double drift_step_m = 0;         ///< kDriftSpeed_mps·T
  double relax_share = 0;          ///< 1 − e^(−T/relax_time)
  double max_turn_rad = 0;         ///< 2 rad/s·T
  FixtureSteepness fixture_steepness;
  double fixture_push = 0;  ///< ½ for a CONSERVATIVE fixture, 0 for a PROPORTIONAL one
  double lay_again_m = 0;   ///< d_t up to which a turn lays the layers along u again
  double aim_share = 0;     ///< 1 − e^(−T/kAimTime_s)
  TrackingWallSpec wall;
  VirtualFixtureSpec fixture;
  OrientationLimitSpec orientation;
  double friction_stiffness_N_per_m = 0;
  double needle_length_m = 0;
  double needle_length_squared_m2 = 0;
  double inverse_needle_squared_per_m2 = 0;
  double max_force_N = 0;
  double surely_below_cap_N = 0;     ///< max_force_N less a margin for rounding
  bool is_plane = false;             ///< the limb is this half-space
  Vec3 plane_point_m, plane_normal;  ///< … with its unit normal out of the tissue
  Limb limb;                         ///< plane normal made a unit vector
  std::array<CompiledLayer, kMaxLayers> layers;
  std::uint32_t layer_count = 0;
  CompiledLayer
      beyond;  ///< used where the tip came out on the other side of the limb: the skin's K_t, no force
  std::array<CompiledMembrane, kMaxLayers> membranes;
  std::uint32_t membrane_count = 0;
  std::array<std::uint8_t, kMaxLayers>
      membrane_ids{};   ///< for CUT_MEMORY: its number; in a body, its structure
  EffectMask live = 0;  ///< listed by the scene, with numbers that are not all zero

  // along u
  AxialModel axial_model = AxialModel::kEnhancedTrackingWall;
  StepFunction step_function = nullptr;                  ///< for that model with these live effects
  StepFunction placed_step = nullptr;                    ///< the same without the stages
  std::array<StageFunction, kMaxStages> stages{};        ///< the live ones …
  std::uint32_t stage_count = 0;                         ///< … their number
  std::array<StageNumbers, kMaxStages> stage_numbers{};  ///< ready for the tick, by `stageOf`
  double axial_stiffness_N_per_m = 0;                    ///< steepest slope of the axial model's force over x
  double axial_damping_Ns_per_m = 0;              ///< steepest slope of that force over the speed: VOIGT's B
  double velocity_noise_m = 0;                    ///< VOIGT
  bool step_at_layers = false;                    ///< DIRECT
  std::shared_ptr<const DepthTable> depth_table;  ///< PRECOMPUTED
  std::shared_ptr<const StatisticalTarget> statistical;  ///< STATISTICAL

  std::shared_ptr<const FemNeedle> fem;             ///< FEM
  std::shared_ptr<const ShaftLimits> shaft_limits;  ///< OKAMURA, DAHL
  CutReach cut_reach = nullptr;                     ///< null: the model has no wall that cuts

  // BONE; null and 0 if it is not live
  HoldFunction hold = nullptr;
  std::uint32_t bone_layer = 0;    ///< the outermost layer of bone
  double bone_top_m = 0;           ///< its top
  bool bone_is_plane = false;      ///< the limb is a plane, and so is the bone
  Vec3 bone_point_m, bone_normal;  ///< … with its unit normal out of the bone
  PlacedBones bones;               ///< on a path in a body: instead of all these
  PlacedSurroundings around;       ///< PALPATION, on a path in a body
  bool in_body = false;            ///< of a path in a body: a structure may come more than once

  /// A body: what its paths are compiled from (path_stack.h); null for all other limbs. Such a model is not
  /// stepped itself, only those of its paths.
  std::shared_ptr<const SceneSpec> body_spec;

  [[nodiscard]] bool isLive(Effect effect) const { return (live & bitOf(effect)) != 0; }
  /// The greatest stiffness that can act at once along the trajectory: that of `alongStiffness`. A device
  /// refuses a scene above the stiffness that it can render.
  [[nodiscard]] double axialStiffness_N_per_m() const;
};

/// What makes up `axialStiffness_N_per_m`.
AlongStiffness alongStiffness(const SceneModel& model);

/// The step function of a scene with live stages: `placed_step`, then the stages, then the cap.
void stepWithStages(const SceneModel& model, const TipSample& sample, SimState& state,
                    StepReport& report) noexcept;
/// As stepWithStages, for scenes in which a stage holds the tip that the tissue feels (`hold`).
void stepHeld(const SceneModel& model, const TipSample& sample, SimState& state, StepReport& report) noexcept;

/// Validates, then precomputes for a loop of `rate_hz` (50-40,000 Hz). `steepness`: of a path, the body's, as
/// to find it takes as long as the rest. Errors: kInvalidInput as `validate`.
Result<SceneModel> compile(const SceneSpec& spec, double rate_hz,
                           const FixtureSteepness* steepness = nullptr);

/// Signed depth δ of a point in the limb: negative outside, positive inside (FORCE_MODEL.md, "Contact").
double signedDepth(const Limb& limb, Vec3 p_W_m);
/// Signed depth δ in the scene's limb.
double depthInLimb(const SceneModel& model, const Vec3& p_W_m) noexcept;

/// The tilt limit α(d) = atan((L − d)/(L + d)), paper eq. 7, `d` clamped to [0, L]. In rad; π/4 at d = 0.
double orientationLimitAngle(double needle_length_m, double insertion_m);

}  // namespace needlelab
