/// An exercise's planned line: where the needle shall go in, and which way. Checks, and distances from it.
#pragma once

#include <numbers>
#include <optional>
#include <string>

#include "common/base/result.h"
#include "common/haptics/geometry.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// A planned entry may lie this far from the skin: the numbers of a person are rounded.
inline constexpr double kPlanOffSkin_m = 1e-3;
/// The least angle between a planned line and the skin. Below it the engine does not follow the needle's
/// axis.
inline constexpr double kLeastPlanSlope_rad = 10 * std::numbers::pi / 180;

/// A straight line without ends; all in one frame.
struct PlannedLine {
  Vec3 entry_m;    ///< the planned entry, a point of the line
  Vec3 direction;  ///< unit vector into the tissue
};

/// The exercise's planned line in the frame A, where `X_AL` is the pose of the profile's frame L in A.
/// Nothing: the exercise has no plan, or (only without `parseExercise`) one that is not a line of finite
/// numbers.
std::optional<PlannedLine> plannedLineOf(const pb::Exercise& exercise, const Pose& X_AL = {});

/// Returns the distance of a point from the line, at a right angle: |r − (r·d) d| with r = p − entry.
double distanceFrom(const PlannedLine& line, Vec3 p_m);
/// Returns the angle between an axis (unit, from hub to tip) and the line's direction, 0 to π:
/// atan2(|a × d|, a · d).
double angleTo(const PlannedLine& line, Vec3 axis);

/// Checks the plan alone: one of direction and target, and neither of length 0. `path` names it in messages.
/// Errors: kInvalidInput.
Status checkPlanFields(const pb::Exercise::Plan& plan, const std::string& path);

/// Checks an exercise's plan with its profile: the entry is on the skin (within kPlanOffSkin_m), the line
/// goes into the tissue at kLeastPlanSlope_rad to the skin or more, and the needle reaches the plan's target.
/// An exercise without a plan is right. Errors: kInvalidInput, `PATH.plan.entry_m: …`, with what would be
/// right; `path` is the exercise's, empty for one that stands alone.
Status checkPlan(const pb::Exercise& exercise, const pb::Profile& profile, const std::string& path);

}  // namespace needlelab
