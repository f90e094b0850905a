/// An exercise's planned line: where and in which direction the needle should enter. Checks the plan and
/// measures distances from the line.
#pragma once

#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/base/units.h"
#include "common/haptics/geometry.h"
#include "common/haptics/scene_spec.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// A planned entry may be this far from the skin, because people round numbers.
inline constexpr double kPlanOffSkin_m = 1e-3;
/// On a volume, whose skin has no formula, it may be this far away, along the line; it is put on the skin.
inline constexpr double kPlanOffVolume_m = 0.02;
/// The minimum angle between a planned line and the skin. Below it the engine does not follow the needle's
/// axis.
inline constexpr double kMinPlanSlope_rad = radOf(10);

/// An infinite straight line; all values are in one frame.
struct PlannedLine {
  Vec3 entry_m;    ///< the planned entry, a point of the line
  Vec3 direction;  ///< unit vector into the tissue
};

/// The exercise's planned line in the frame A, where `X_AL` is the pose of the profile's frame L in A.
/// Returns nothing if the exercise has no plan, or if the plan (only without `parseExercise`) is not a line
/// of finite numbers.
std::optional<PlannedLine> plannedLineOf(const pb::Exercise& exercise, const Pose& X_AL = {});

/// On a volume, the line with its entry moved along it to where it goes through the skin, at most
/// kPlanOffVolume_m away; nothing if it does not. On other limbs the line itself. Same frame for both.
std::optional<PlannedLine> onSkin(const PlannedLine& line, const Limb& limb);

/// Returns the perpendicular distance of a point from the line: |r − (r·d) d| with r = p − entry.
double distanceFrom(const PlannedLine& line, Vec3 p_m);
/// Returns the angle between an axis (unit, from hub to tip) and the line's direction, 0 to π:
/// atan2(|a × d|, a · d).
double angleTo(const PlannedLine& line, Vec3 axis);

/// Checks the plan alone: it has either a direction or a target, not of length 0. `path` names it in
/// messages. Errors: kInvalidInput.
Status checkPlanFields(const pb::Exercise::Plan& plan, const std::string& path);

/// Checks an exercise's plan with its profile: the entry is on the skin (within kPlanOffSkin_m, or, on a
/// volume, as onSkin), the line goes into the tissue at kMinPlanSlope_rad to the skin or more, and the needle
/// reaches the plan's target. An exercise without a plan passes. Errors: kInvalidInput, `PATH.plan.entry_m:
/// …`, with the remedy; `path` is the exercise's, empty for a separate exercise.
Status checkPlan(const pb::Exercise& exercise, const pb::Profile& profile, const std::string& path);

}  // namespace needlelab
