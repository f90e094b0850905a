#include "profile/rules.h"

#include <set>

#include "base/range.h"
#include "profile/model_sections.h"
#include "profile/needle.h"
#include "profile/profile.h"
#include "profile/strict_json.h"

namespace needlelab {
namespace {

/// Ids become file names and arguments: nothing in them needs quoting, and none hides or climbs folders.
Status checkId(const std::string& path, const std::string& id) {
  const char* const allowed = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.";
  if (id.find_first_not_of(allowed) != std::string::npos || id.starts_with(".") || id.starts_with("-")) {
    return fieldError(
        path, quotedText(id) +
                  " may hold letters, digits, '-', '_' and '.', and begins with a letter, digit or '_'");
  }
  return {};
}

Status checkEffects(const pb::Profile& profile) {
  std::set<int> listed;
  for (int i = 0; i < profile.effects_size(); ++i) {
    const std::string& name = pb::Profile::Effect_Name(profile.effects(i));
    if (!listed.insert(profile.effects(i)).second) {
      return fieldError("effects[" + std::to_string(i) + "]", name + " is listed twice");
    }
  }
  // the section of each listed effect; CUTTING and ATTRACTED use tracking_wall, PUNCTURE stands in the layers
  const auto missing = [&](pb::Profile::Effect effect, bool there) {
    return listed.contains(effect) && !there;
  };
  if (missing(pb::Profile::CLAMPING, profile.has_virtual_fixture())) {
    return fieldError("virtual_fixture", "is missing, and effects lists CLAMPING");
  }
  if (missing(pb::Profile::ORIENTATION_LIMIT, profile.has_orientation_limit())) {
    return fieldError("orientation_limit", "is missing, and effects lists ORIENTATION_LIMIT");
  }
  if (missing(pb::Profile::SHAFT_FRICTION, profile.has_shaft_friction())) {
    return fieldError("shaft_friction", "is missing, and effects lists SHAFT_FRICTION");
  }
  return {};
}

Status checkStopMode(const pb::TrackingWall& wall) {
  if (wall.stop_mode() != pb::TrackingWall::EXPONENTIAL) return {};
  const char* const words = "is missing, and stop_mode is EXPONENTIAL";
  if (!wall.has_relax_time_s()) return fieldError("tracking_wall.relax_time_s", words);
  if (!wall.has_relax_residual()) return fieldError("tracking_wall.relax_residual", words);
  return {};
}

Status checkHazard(const pb::Hazard& hazard, const std::string& path) {
  const bool some_segment = hazard.has_a_m() || hazard.has_b_m();
  const bool whole_segment = hazard.has_a_m() && hazard.has_b_m();
  if (hazard.has_center_m() == some_segment) {
    return fieldError(path, std::string("give either center_m or a segment a_m, b_m; found ") +
                                (some_segment ? "both" : "neither"));
  }
  if (some_segment && !whole_segment) {
    return fieldError(path, std::string("a segment needs a_m and b_m; ") +
                                (hazard.has_a_m() ? "b_m" : "a_m") + " is missing");
  }
  if (whole_segment) {
    const Vec3 along{hazard.b_m().x() - hazard.a_m().x(), hazard.b_m().y() - hazard.a_m().y(),
                     hazard.b_m().z() - hazard.a_m().z()};
    // the same bound as for capsules in haptics
    if (norm(along) < 1e-6)
      return fieldError(path + ".b_m", "is the same point as a_m: use center_m for a ball");
  }
  return {};
}

}  // namespace

Status checkProfileRules(const pb::Profile& profile) {
  if (Status status = checkId("id", profile.id()); !status) return status;
  if (Status status = checkNeedle(profile.needle()); !status) return status;
  if (Status status = checkEffects(profile); !status) return status;
  if (Status status = checkModelSection(profile); !status) return status;
  if (Status status = checkStopMode(profile.tracking_wall()); !status) return status;
  std::set<std::string> names;
  for (int i = 0; i < profile.targets_size(); ++i) {
    if (!names.insert(profile.targets(i).name()).second) {
      return fieldError("targets[" + std::to_string(i) + "].name",
                        quotedText(profile.targets(i).name()) + " is used twice");
    }
  }
  names.clear();
  for (int i = 0; i < profile.hazards_size(); ++i) {
    const std::string path = "hazards[" + std::to_string(i) + "]";
    if (Status status = checkHazard(profile.hazards(i), path); !status) return status;
    if (!names.insert(profile.hazards(i).name()).second) {
      return fieldError(path + ".name", quotedText(profile.hazards(i).name()) + " is used twice");
    }
  }
  // all that concerns forces and shapes is the engine's own check: one place for it
  const Result<SceneSpec> spec = sceneSpecOf(profile);
  if (!spec) return spec.error();
  return {};
}

Status checkExerciseRules(const pb::Exercise& exercise, const std::string& path) {
  const std::string prefix = path.empty() ? "" : path + ".";
  if (Status status = checkId(prefix + "id", exercise.id()); !status) return status;
  if (Status status = checkId(prefix + "profile_id", exercise.profile_id()); !status) return status;
  for (int i = 0; i < exercise.requirements_size(); ++i) {
    const auto& requirement = exercise.requirements(i);
    const std::string where = prefix + "requirements[" + std::to_string(i) + "]";
    if (!requirement.has_min() && !requirement.has_max()) {
      return fieldError(where, "says nothing about " + requirement.measure() + ": give min, max or both");
    }
    if (requirement.has_min() && requirement.has_max() && requirement.min() > requirement.max()) {
      return fieldError(where + ".min",
                        numberText(requirement.min()) + " is above max, " + numberText(requirement.max()));
    }
  }
  return {};
}

Status checkCurriculumRules(const pb::Curriculum& curriculum) {
  if (Status status = checkId("id", curriculum.id()); !status) return status;
  std::set<std::string> ids;
  for (int i = 0; i < curriculum.exercises_size(); ++i) {
    const std::string path = "exercises[" + std::to_string(i) + "]";
    if (Status status = checkExerciseRules(curriculum.exercises(i), path); !status) return status;
    if (!ids.insert(curriculum.exercises(i).id()).second) {
      return fieldError(path + ".id", quotedText(curriculum.exercises(i).id()) + " is used twice");
    }
  }
  return {};
}

}  // namespace needlelab
