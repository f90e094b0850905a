/// A scene as plain values, as written by its author, before it is validated and compiled.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "common/base/result.h"
#include "common/haptics/axial_model.h"
#include "common/haptics/body.h"
#include "common/haptics/geometry.h"

namespace needlelab {

// Fixed capacities and absolute bounds of the engine, with their reasons.

inline constexpr std::size_t kMaxLayers = 32;  ///< layers of a profile
inline constexpr double kMinRateHz = 50;       ///< below this, the 100 ms speed window has fewer than 5 ticks
inline constexpr double kMaxRateHz = 40'000;   ///< the fastest loop in the literature (Choi and Tan)
/// Ring of past positions for the speed over 100 ms: 4,000 ticks at 40 kHz, plus the tick before entry.
inline constexpr std::size_t kHistoryCapacity = 4096;
static_assert(kHistoryCapacity > static_cast<std::size_t>(kMaxRateHz / 10) + 1);

/// The greatest number of stations of a needle: bounds the state and the cost of a tick.
inline constexpr std::size_t kMaxNeedleStations = 128;

/// The greatest number of cuts that CUT_MEMORY remembers: bounds the state, its hash and the cost of a tick.
inline constexpr std::size_t kMaxCutTracks = 16;

/// The effects that a scene may use, in the order of the EffectMask bits. effects/effect_entry.h has one row
/// per effect.
enum class Effect : std::uint8_t {
  kCutting,
  kAttracted,
  kClamping,
  kOrientationLimit,
  kShaftFriction,
  kPuncture,
  kCutMemory,
  kBone,
  kHub,
  kPalpation
};
/// Always 0, except in tests/instructions, which compiles the engine with extra effects to measure their
/// cost.
#ifdef NEEDLELAB_DUMMY_EFFECTS
inline constexpr std::size_t kDummyEffectCount = NEEDLELAB_DUMMY_EFFECTS;
#else
inline constexpr std::size_t kDummyEffectCount = 0;
#endif
inline constexpr std::size_t kEffectCount = 10 + kDummyEffectCount;
/// The number of effects with a fixed place within the tick. The others are stages, whose forces are added at
/// the end, except HUB, which acts only when the needle is inserted to its hub, and PALPATION, which acts
/// instead of all others.
inline constexpr std::size_t kPlacedEffectCount = 6;

using EffectMask = std::uint32_t;
constexpr EffectMask bitOf(Effect effect) {
  return EffectMask{1} << static_cast<unsigned>(effect);
}
inline constexpr EffectMask kAllEffects = (EffectMask{1} << kEffectCount) - 1;
/// Those of a needle without its cap: all but PALPATION, which has ticks of its own.
inline constexpr EffectMask kNeedleEffects = kAllEffects & ~bitOf(Effect::kPalpation);
inline constexpr EffectMask kPlacedEffects = (EffectMask{1} << kPlacedEffectCount) - 1;
constexpr bool isPlaced(Effect effect) {
  return (bitOf(effect) & kPlacedEffects) != 0;
}

/// Capacity for stages. StageNumbers holds a stage's numbers from the author, for the tick, or remembered
/// between ticks; the stage defines their meaning.
inline constexpr std::size_t kMaxStages = 8;
using StageNumbers = std::array<double, 9>;
static_assert(kEffectCount - kPlacedEffectCount <= kMaxStages);
constexpr std::size_t stageOf(Effect effect) {
  return static_cast<std::size_t>(effect) - kPlacedEffectCount;
}

/// The places of BONE's stiffness and coefficient of friction among its numbers.
inline constexpr std::size_t kBoneStiffness_N_per_m = 0, kBoneFriction = 1;
/// The place of HUB's stiffness among its numbers.
inline constexpr std::size_t kHubStiffness_N_per_m = 0;
/// The places of PALPATION's numbers.
inline constexpr std::size_t kPalpationSkin_N_per_m = 0, kPalpationBone_N_per_m = 1, kPalpationFriction = 2,
                             kPalpationRadius_m = 3, kPalpationStiffening = 4;

/// The half-space on the far side of `normal`; `normal` (any length > 0) points out of the tissue.
struct PlaneLimb {
  Vec3 point_m;
  Vec3 normal;
};
struct SphereLimb {
  Vec3 center_m;
  double radius_m = 0;
};
/// All points within `radius_m` of the segment a-b.
struct CapsuleLimb {
  Vec3 a_m, b_m;
  double radius_m = 0;
};
/// A patient's body, with its frame L placed in W. The scene's layers are the body's structures, in no order
/// of depth; their thickness has no meaning.
struct BodyLimb {
  std::shared_ptr<const Body> body;  ///< not null
  Pose X_WL;
};
using Limb = std::variant<PlaneLimb, SphereLimb, CapsuleLimb, BodyLimb>;

/// A membrane at a layer's top: force k1 z + k2 z² until it ruptures at `force_N` (FORCE_MODEL.md,
/// "Puncture").
struct MembraneSpec {
  double linear_N_per_m = 0;
  double quadratic_N_per_m2 = 0;
  double force_N = 0;
};

struct LayerSpec {
  double thickness_m = 0;                 ///< along the surface normal, (0, 1]
  double cutting_force_N = 0;             ///< [0, 50]
  double attracted_force_N = 0;           ///< [0, 50]
  double rejection_force_N = 0;           ///< at most min(cutting, attracted where live)
  double lateral_stiffness_N_per_m2 = 0;  ///< clamping stiffness per inserted length, [0, 1e7]
  double friction_N_per_m = 0;            ///< shaft friction per inserted length, [0, 1e4]
  std::optional<MembraneSpec> membrane;
  std::optional<FirstOrderSpec> first_order;  ///< required in every layer if the model is FIRST_ORDER
  std::optional<OkamuraSpec> okamura;         ///< required in every layer if the model is OKAMURA or DAHL
  bool is_bone = false;                       ///< BONE: no needle enters it
  /// K_t in this layer, (0, 10000]; absent: the scene's. Only for ENHANCED_TRACKING_WALL and TRACKING_WALL.
  std::optional<double> wall_stiffness_N_per_m;
};

enum class StopMode : std::uint8_t { kRamp, kExponential };
enum class ClampingMode : std::uint8_t { kProportional, kConservative };

struct TrackingWallSpec {
  double stiffness_N_per_m = 500;  ///< K_t, (0, 10000]
  double stop_speed_mps = 0.003;   ///< v_stop, (0, 0.1]
  double stop_dwell_s = 0.05;      ///< (0, 10]
  double stop_duration_s = 0.8;    ///< (0, 10]
  StopMode stop_mode = StopMode::kRamp;
  double relax_time_s = 1.9;     ///< EXPONENTIAL: (0, 60]
  double relax_residual = 0.75;  ///< EXPONENTIAL: [0, 1]
};

struct VirtualFixtureSpec {
  double max_stiffness_N_per_m = 400;  ///< (0, 10000]
  double max_force_N = 4;              ///< [0, 50]
  ClampingMode mode = ClampingMode::kProportional;
};

struct OrientationLimitSpec {
  double stiffness_Nm_per_rad = 0;  ///< [0, 100]
  double max_torque_Nm = 0;         ///< [0, 5]
};

/// Everything that the engine needs to know about a scene, in W (the limb is already placed).
struct SceneSpec {
  double needle_length_m = 0.06;  ///< L, (0, 1]
  double needle_diameter_m = 0;   ///< outer, up to 0.005; 0: not given. FEM's needle has this diameter
  Limb limb = PlaneLimb{{0, 0, 0}, {0, 0, 1}};
  std::vector<LayerSpec> layers;  ///< 1-32, from the skin inward
  AxialModel axial_model = AxialModel::kEnhancedTrackingWall;
  TrackingWallSpec tracking_wall;
  DirectSpec direct;
  VoigtSpec voigt;
  GodObjectSpec god_object;
  StatisticalSpec statistical;
  PrecomputedSpec precomputed;
  FemSpec fem;
  VirtualFixtureSpec virtual_fixture;
  OrientationLimitSpec orientation_limit;
  double friction_stiffness_N_per_m = 140;               ///< K_f, (0, 10000]
  double max_force_N = 10;                               ///< cap of the sum, (0, 50]
  std::array<StageNumbers, kMaxStages> stage_numbers{};  ///< for effects that are stages, by `stageOf`
  /// BONE, on a plane limb: the direction out of the bone, any length > 0, at most 60 degrees from the skin's
  /// normal. Absent: parallel to the skin.
  std::optional<Vec3> bone_normal;
  EffectMask effects = 0;  ///< the listed effects; the live effects are derived
};

/// Returns the first fault of a spec as kInvalidInput with field path, value and range, or success. `compile`
/// calls it. Field paths are those of the profile's JSON, e.g. `layers[2].cutting_force_n`.
Status validate(const SceneSpec& spec);

/// Transforms a limb from the author's frame L to W; `X_WL` is the pose of L in W.
Limb placed(const Limb& limb, const Pose& X_WL);

}  // namespace needlelab
