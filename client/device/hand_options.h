/// A hand from the command line: the `--hand-…` options, levels of skill, and the plan that `--hand-plan`
/// names.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/device/hand.h"
#include "client/device/hand_plan.h"
#include "common/base/result.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// A person who reaches for a target corrects the aim; see HandOptions::correction_per_s.
inline constexpr double kCommandLineCorrection_per_s = 2;

/// Adds the options to `app`, and sets the command line's own default in `options`, which must live until
/// parsing is done. Values out of range are CLI11 parse errors.
void addHandOptions(CLI::App& app, HandOptions& options);

/// Properties of a hand that depend on its skill. The two ends were chosen within the range of human hands;
/// they are not measurements.
struct HandSkill {
  double tremor_m = 0;     ///< peak per axis
  double speed_mps = 0;    ///< greatest, of insertion and withdrawal
  double aim_m = 0;        ///< spread of entry and of the point aimed at, across the way, per axis
  double overshoot_m = 0;  ///< mean way beyond the target before it is drawn back
  double pieces = 1;       ///< into how many movements the insertion breaks up: smoothness
};

/// `level`: 0 a beginner, 1 an expert; between them each quantity goes along a geometric row.
HandSkill skillOf(double level);

/// Where the profile's author marked the skin: the origin of the limb's frame, where it lies on the surface
/// (as in all of db/samples); nothing elsewhere.
std::optional<Vec3> markedEntry(const Limb& limb_W, const Pose& X_WL);

/// One attempt at `target_W_m` with this skill, by way of `entry_W_m` or, without one, the shortest way:
/// where it aims, how far it overshoots, where it hesitates are drawn from `random`; aspirates and injects at
/// the end, whatever the skill.
HandPlan attemptPlan(const HandSkill& skill, const Limb& limb_W, Vec3 target_W_m, HandRandom& random,
                     std::optional<Vec3> entry_W_m = std::nullopt);

/// The hand that pursues such a plan.
HandOptions handOf(const HandSkill& skill, std::uint64_t seed);

/// The plan of a hand that is steered while it moves.
inline constexpr const char* kPointerPlan = "pointer";

/// A target of the profile, already placed in W.
struct PlanTarget {
  std::string name;
  Vec3 center_W_m;
  std::optional<Vec3> entry_W_m = std::nullopt;  ///< where its author marked the skin
};

/// Makes the plan that `options.plan` names:
/// - `target` or `target:NAME`: straight to that target (the first one without a name; without any target as
/// `depth`);
///   with `options.skill` an attempt of that skill (attemptPlan), by way of the marked entry;
/// - `retry` or `retry:NAME`: first beside it, then drawn back, turned, and into it (paper, Fig. 10);
/// - `depth:METRES`: straight in by that depth above the limb's reference point; `depth` alone: half of the
/// layers;
/// - `rest`: stays 20 mm outside for the time of the hold;
/// - anything else: a CSV file of tip poses in W as readPoseTrack reads it, straight lines between its rows.
/// Errors: kInvalidInput.
/// `pointer` is refused: such a hand has no plan, see steeredStart.
Result<HandPlan> choosePlan(const HandOptions& options, const SceneSpec& scene_W,
                            const std::vector<PlanTarget>& targets_W);

/// Where a steered hand (kPointerPlan) waits: upright, 30 mm outside the marked entry of the
/// first target, or else the limb's reference point, and 15 mm beside it: to aim is part of the exercise.
HandPlan steeredStart(const SceneSpec& scene_W, const std::vector<PlanTarget>& targets_W);

}  // namespace needlelab
