#include "common/profile/rules.h"

#include <cmath>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "common/base/range.h"
#include "common/profile/aid_list.h"
#include "common/profile/model_sections.h"
#include "common/profile/needle.h"
#include "common/profile/profile.h"
#include "common/profile/strict_json.h"

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
  if (exercise.has_needle()) {
    if (Status status = checkNeedle(exercise.needle()); !status)
      return Error{status.error().code, prefix + status.error().message};
  }
  if (Status status = checkAids(prefix + "aids.allowed", exercise.aids().allowed()); !status) return status;
  if (exercise.has_due_unix_ms() && exercise.due_unix_ms() != std::floor(exercise.due_unix_ms()))
    return fieldError(prefix + "due_unix_ms",
                      "must be a whole number of milliseconds, found " + numberText(exercise.due_unix_ms()));
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

namespace {

/// Exercises of a course and what must be passed before them.
class Prerequisites {
 public:
  explicit Prerequisites(const pb::Curriculum& curriculum) : exercises_(curriculum.exercises()) {
    for (int i = 0; i < exercises_.size(); ++i) index_[exercises_[i].id()] = i;
    state_.resize(static_cast<std::size_t>(exercises_.size()), State::kNew);
  }

  /// All are exercises of this course, each once, none of them itself, and nothing waits for itself by way of
  /// others.
  Status check() {
    for (int i = 0; i < exercises_.size(); ++i) {
      std::set<std::string> named;
      for (int j = 0; j < exercises_[i].prerequisites_size(); ++j) {
        const std::string& id = exercises_[i].prerequisites(j);
        const std::string path =
            "exercises[" + std::to_string(i) + "].prerequisites[" + std::to_string(j) + "]";
        if (!index_.contains(id)) return fieldError(path, quotedText(id) + " is no exercise of this course");
        if (!named.insert(id).second) return fieldError(path, quotedText(id) + " is named twice");
      }
    }
    for (int i = 0; i < exercises_.size(); ++i)
      if (Status status = visit(i); !status) return status;
    return {};
  }

 private:
  enum class State { kNew, kOnTheWay, kDone };

  /// Without recursion: a course may have a thousand exercises in one line.
  Status visit(int first) {
    struct Step {
      int exercise = 0, next = 0;
    };
    std::vector<Step> way;
    const auto enter = [&](int i) {
      state_[static_cast<std::size_t>(i)] = State::kOnTheWay;
      way.push_back({i, 0});
    };
    if (state_[static_cast<std::size_t>(first)] == State::kNew) enter(first);
    while (!way.empty()) {
      Step& step = way.back();
      const pb::Exercise& exercise = exercises_[step.exercise];
      if (step.next == exercise.prerequisites_size()) {
        state_[static_cast<std::size_t>(step.exercise)] = State::kDone;
        way.pop_back();
        continue;
      }
      const int next = index_.at(exercise.prerequisites(step.next++));
      const State state = state_[static_cast<std::size_t>(next)];
      if (state == State::kNew) enter(next);
      if (state != State::kOnTheWay) continue;
      // the circle: from where it was entered back to there
      std::string circle;
      bool inside = false;
      for (const Step& on_way : way) {
        inside = inside || on_way.exercise == next;
        if (inside) circle += quotedText(exercises_[on_way.exercise].id()) + " needs ";
      }
      return fieldError("exercises[" + std::to_string(way.back().exercise) + "].prerequisites",
                        "go round in a circle, so that none of these can ever begin: " + circle +
                            quotedText(exercises_[next].id()));
    }
    return {};
  }

  const google::protobuf::RepeatedPtrField<pb::Exercise>& exercises_;
  std::map<std::string, int> index_;
  std::vector<State> state_;
};

}  // namespace

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
  return Prerequisites(curriculum).check();
}

}  // namespace needlelab
