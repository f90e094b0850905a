#include "common/profile/planned_line.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <variant>

#include "common/base/text/strict_json.h"
#include "common/base/units.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/surface.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

/// Two points closer than this do not define a direction; same limit as for segments of hazards.
constexpr double kMinLength_m = 1e-6;

/// A vector from the entry along the line, of any length.
Vec3 alongOf(const pb::Exercise::Plan& plan) {
  return plan.has_direction() ? vectorOf(plan.direction())
                              : vectorOf(plan.target_m()) - vectorOf(plan.entry_m());
}

/// The length of `alongOf`; 0 if it is too short to have a direction.
double lengthOf(const pb::Exercise::Plan& plan) {
  const Vec3 along = alongOf(plan);
  const double length = std::hypot(along.x, along.y, along.z);  // squares of small numbers would vanish
  return !plan.has_direction() && length < kMinLength_m ? 0 : length;
}

std::string millimetres(Vec3 p_m) {
  // + 0.0: no "-0"
  return fmt::format("({:.4g}, {:.4g}, {:.4g}) mm", 1e3 * p_m.x + 0.0, 1e3 * p_m.y + 0.0, 1e3 * p_m.z + 0.0);
}

}  // namespace

std::optional<PlannedLine> plannedLineOf(const pb::Exercise& exercise, const Pose& X_AL) {
  if (!exercise.has_plan()) return std::nullopt;
  const pb::Exercise::Plan& plan = exercise.plan();
  const Vec3 entry_m = vectorOf(plan.entry_m()), along = alongOf(plan);
  const double length = lengthOf(plan);
  if (!isFinite(entry_m) || !std::isfinite(length) || length == 0) return std::nullopt;
  const Pose X{X_AL.p, normalized(X_AL.q)};
  return PlannedLine{X * entry_m, rotate(X.q, along / length)};
}

std::optional<PlannedLine> onSkin(const PlannedLine& line, const Limb& limb) {
  if (!std::holds_alternative<BodyLimb>(limb)) return line;
  constexpr double kFinest_m = 1e-4, kFound_m = 1e-7;
  const auto depth = [&](double t_m) { return signedDepth(limb, line.entry_m + line.direction * t_m); };
  // from outside onwards, from inside back
  const double depth_m = depth(0), side = depth_m > 0 ? -1 : 1;
  double near_m = 0, far_m = 0;
  for (double here_m = depth_m; (here_m > 0) == (depth_m > 0); here_m = depth(side * far_m)) {
    if (far_m >= kPlanOffVolume_m) return std::nullopt;
    near_m = far_m;
    far_m = std::min(kPlanOffVolume_m, far_m + std::max(0.5 * std::abs(here_m), kFinest_m));
  }
  while (far_m - near_m > kFound_m) {
    const double middle_m = 0.5 * (near_m + far_m);
    ((depth(side * middle_m) > 0) == (depth_m > 0) ? near_m : far_m) = middle_m;
  }
  return PlannedLine{line.entry_m + line.direction * (side * near_m), line.direction};
}

double distanceFrom(const PlannedLine& line, Vec3 p_m) {
  const Vec3 r = p_m - line.entry_m;
  return norm(r - dot(r, line.direction) * line.direction);
}

double angleTo(const PlannedLine& line, Vec3 axis) {
  return std::atan2(norm(cross(axis, line.direction)), dot(axis, line.direction));
}

Status checkPlanFields(const pb::Exercise::Plan& plan, const std::string& path) {
  if (plan.has_direction() == plan.has_target_m())
    return fieldError(path, std::string("give either direction or target_m; found ") +
                                (plan.has_direction() ? "both" : "neither"));
  if (lengthOf(plan) > 0) return {};
  if (plan.has_direction())
    return fieldError(path + ".direction", "has the length 0: give any vector that points into the tissue");
  return fieldError(path + ".target_m", "is the same point as entry_m: give a point further along the line");
}

Status checkPlan(const pb::Exercise& exercise, const pb::Profile& profile, const std::string& path) {
  auto line = plannedLineOf(exercise);
  if (!line) return {};
  const std::string plan = path.empty() ? "plan" : path + ".plan";
  ASSIGN_OR_RETURN(const auto scene, sceneSpecOf(profile));

  // a plane's normal may have any length
  Limb limb = scene.limb;
  if (auto* const plane = std::get_if<PlaneLimb>(&limb)) plane->normal = normalized(plane->normal);
  const auto placed = onSkin(*line, limb);
  if (!placed)
    return fieldError(
        plan + ".entry_m",
        fmt::format("{} is {:.3g} mm {} the skin of profile '{}', and the line does not meet it within "
                    "{:g} mm: give a point of the line nearer to where it goes in",
                    millimetres(line->entry_m), 1e3 * std::abs(signedDepth(limb, line->entry_m)),
                    signedDepth(limb, line->entry_m) > 0 ? "below" : "above", profile.id(),
                    1e3 * kPlanOffVolume_m));
  line = placed;
  const double depth_m = signedDepth(limb, line->entry_m);
  const Vec3 normal = surfaceNormal(limb, line->entry_m, line->direction);
  if (std::abs(depth_m) > kPlanOffSkin_m)
    return fieldError(
        plan + ".entry_m",
        fmt::format("{} is {:.3g} mm {} the skin of profile '{}', allowed is {:g} mm: the "
                    "nearest point of the skin is {}",
                    millimetres(line->entry_m), 1e3 * std::abs(depth_m), depth_m > 0 ? "below" : "above",
                    profile.id(), 1e3 * kPlanOffSkin_m, millimetres(line->entry_m + depth_m * normal)));
  const bool has_target = exercise.plan().has_target_m();
  const std::string where = plan + (has_target ? ".target_m" : ".direction");
  const double slope_rad = std::asin(std::clamp(-dot(normal, line->direction), -1.0, 1.0));
  if (slope_rad < kMinPlanSlope_rad)
    return fieldError(
        where, fmt::format("the line {} at {:.3g}° to the skin of profile '{}': it has to go in "
                           "at {:g}° to the skin or more",
                           slope_rad < 0 ? "comes out of the tissue" : "goes in",
                           degreesOf(std::abs(slope_rad)), profile.id(), degreesOf(kMinPlanSlope_rad)));
  const double needle_m = (exercise.has_needle() ? exercise.needle() : profile.needle()).length_m();
  if (const double way_m = norm(vectorOf(exercise.plan().target_m()) - line->entry_m);
      has_target && way_m > needle_m)
    return fieldError(where, fmt::format("is {:.3g} mm from the entry, and the needle is {:.3g} mm long",
                                         1e3 * way_m, 1e3 * needle_m));
  return {};
}

}  // namespace needlelab
