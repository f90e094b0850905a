/// The hand's command line: the `--hand-…` options, levels of skill, and the plans of `--hand-plan`.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/device/hand/hand.h"
#include "client/device/hand/hand_plan.h"
#include "common/base/result.h"
#include "common/haptics/scene_spec.h"
#include "common/profile/planned_line.h"

namespace CLI {
class App;
}

namespace needlelab {

/// Default of `correction_per_s` on a command line, because humans correct their aim; see HandOptions.
inline constexpr double kCommandLineCorrection_per_s = 2;

/// Default of `bracing_N_per_m` on a command line, and for an expert. A hand without it springs millimetres
/// forward when the resistance drops, into the bone behind a knee's recess. Chosen by us, not measured.
inline constexpr double kBracing_N_per_m = 700;

/// Adds the options to `app`, and sets the command line's defaults in `options`, which must live until
/// parsing ends. Values out of range are CLI11 parse errors.
void addHandOptions(CLI::App& app, HandOptions& options);

/// Properties of a hand that depend on its skill. We chose the two ends within the range of human hands; they
/// are not measurements.
struct HandSkill {
  double tremor_m = 0;         ///< peak per axis
  double speed_mps = 0;        ///< peak speed of insertion and withdrawal
  double aim_m = 0;            ///< spread of entry and aim point, across the way, per axis
  double overshoot_m = 0;      ///< mean distance beyond the target before drawing back
  double pieces = 1;           ///< number of movements in the insertion: smoothness
  double bracing_N_per_m = 0;  ///< linear from 0, a beginner's
};

/// `level`: 0 is a beginner, 1 an expert; each other quantity is interpolated geometrically between them.
HandSkill skillOf(double level);

/// Returns the entry that the profile's author marked on the skin: the origin of the limb's frame, if it lies
/// on the surface (as in all of db/samples); else nullopt.
std::optional<Vec3> markedEntry(const Limb& limb_W, const Pose& X_WL);

/// Plans one attempt at `target_W_m` with this skill, through `entry_W_m` or, without one, by the shortest
/// way. Draws aim, overshoot and hesitations from `random`. Always aspirates and injects at the end.
HandPlan attemptPlan(const HandSkill& skill, const Limb& limb_W, Vec3 target_W_m, HandRandom& random,
                     std::optional<Vec3> entry_W_m = std::nullopt);

/// Returns the options of a hand with this skill.
HandOptions handOf(const HandSkill& skill, std::uint64_t seed);

/// The plan of a steered hand.
inline constexpr const char* kPointerPlan = "pointer";

/// A target of the profile, placed in W.
struct PlanTarget {
  std::string name;
  Vec3 center_W_m;
  std::optional<Vec3> entry_W_m = std::nullopt;     ///< the marked entry on the skin
  std::optional<Vec3> landmark_W_m = std::nullopt;  ///< where to feel for the profile's landmark: on the bone
};

/// Makes the plan that `options.plan` names:
/// - `target` or `target:NAME`: straight to that target (without a name, the first one; without targets, as
///   `depth`); with `options.skill`, an attempt of that skill (attemptPlan) through the marked entry;
/// - `retry` or `retry:NAME`: first beside the target, then back, turned, and into it (paper, Fig. 10);
/// - `depth:METRES`: straight in by that depth above the limb's reference point; `depth` alone: half of the
///   layers;
/// - `rest`: stays 20 mm outside for the time of the hold;
/// - anything else: a CSV file of tip poses in W (readPoseTrack), with straight lines between its rows.
///
/// With `options.capped`, every plan but `rest` first takes the cap off, `target` and `retry` after feeling
/// for the target's landmark (palpationPlan); one that is repeated puts it on again.
///
/// Errors: kInvalidInput; also for `pointer`, which has no plan (see steeredStart).
Result<HandPlan> choosePlan(const HandOptions& options, const SceneSpec& scene_W,
                            const std::vector<PlanTarget>& targets_W);

/// The way of a needle that goes where it is meant to go, in W.
struct PlannedInsertion {
  Vec3 entry_W_m;      ///< on the skin
  Vec3 direction_W;    ///< unit, into the tissue
  double depth_m = 0;  ///< of the tip, along the line
  std::optional<Vec3> landmark_W_m = std::nullopt;
};
/// On `line_W`, an exercise's plan with its entry on the skin, to beside the first target. Without a line
/// from the target's marked entry, or straight in; without targets as the plan `depth`.
PlannedInsertion plannedInsertion(const SceneSpec& scene_W, const std::vector<PlanTarget>& targets_W,
                                  const std::optional<PlannedLine>& line_W);
/// Returns `plan` for a needle that begins with its cap on: first takes it off, after feeling for the
/// landmark (palpationPlan), if there is one.
HandPlan withCapTakenOff(const HandPlan& plan, const SceneSpec& scene_W,
                         const std::optional<Vec3>& landmark_W_m);

/// How far from the skin a steered hand starts, along the needle.
inline constexpr double kSteeredStart_m = 0.03;
/// Returns the start of a steered hand (kPointerPlan): on the planned way, tilted as planned.
HandPlan steeredStart(const PlannedInsertion& way);

}  // namespace needlelab
