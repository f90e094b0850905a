/// From the words of `--hand-plan` to a plan, for a scene that stands in W.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/device/hand.h"
#include "common/base/result.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

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
///   with `options.skill` an attempt of that skill (skilled_hand.h), by way of the marked entry;
/// - `retry` or `retry:NAME`: first beside it, then drawn back, turned, and into it (paper, Fig. 10);
/// - `depth:METRES`: straight in by that depth above the limb's reference point; `depth` alone: half of the
/// layers;
/// - `rest`: stays 20 mm outside for the time of the hold;
/// - anything else: a CSV file of tip poses in W as readPoseTrack reads it, straight lines between its rows.
/// Errors: kInvalidInput.
/// `pointer` is refused: such a hand has no plan, see steeredStart.
Result<HandPlan> choosePlan(const HandOptions& options, const SceneSpec& scene_W,
                            const std::vector<PlanTarget>& targets_W);

/// Where a hand waits that somebody steers (kPointerPlan): upright, 30 mm outside the marked entry of the
/// first target, or else the limb's reference point, and 15 mm beside it: to aim is part of the exercise.
HandPlan steeredStart(const SceneSpec& scene_W, const std::vector<PlanTarget>& targets_W);

}  // namespace needlelab
