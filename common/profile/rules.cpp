#include "common/profile/rules.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/base/range.h"
#include "common/base/text/strict_json.h"
#include "common/base/text/text.h"
#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/profile/aid_list.h"
#include "common/profile/anchors.h"
#include "common/profile/layer_names.h"
#include "common/profile/planned_line.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/structure_kinds.h"
#include "common/profile/volume.h"

namespace needlelab {
namespace {

/// Ids become file names and arguments: they need no quoting, are not hidden files, and cannot leave a
/// folder.
Status checkId(const std::string& path, const std::string& id) {
  const char* const allowed = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.";
  if (id.find_first_not_of(allowed) != std::string::npos || id.starts_with(".") || id.starts_with("-")) {
    return fieldError(
        path, quotedText(id) +
                  " may hold letters, digits, '-', '_' and '.', and begins with a letter, digit or '_'");
  }
  return {};
}

Status checkWhole(const std::string& path, double time_ms) {
  if (time_ms == std::floor(time_ms)) return {};
  return fieldError(path, "must be a whole number of milliseconds, found " + numberText(time_ms));
}

Status checkNeedle(const pb::Needle& needle) {
  if (needle.has_gauge() && needle.has_outer_diameter_m()) {
    const double wanted = gaugeDiameter_m(needle.gauge()), found = needle.outer_diameter_m();
    if (!(std::abs(found - wanted) <= kGaugeTolerance * wanted))
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("needle.outer_diameter_m: {} contradicts gauge {}, which is {} (allowed is "
                               "{:.4g} to {:.4g}): give one of the two, or both alike",
                               numberText(found), needle.gauge(), numberText(wanted),
                               wanted * (1 - kGaugeTolerance), wanted * (1 + kGaugeTolerance))};
  }
  const NeedleSpec spec = needleOf(needle);
  if (const double behind = openingBehindTip_m(spec), bevel = bevelLength_m(spec);
      std::max(behind, bevel) >= spec.length_m)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("needle.bevel_angle_rad: at {:.3g} rad a tip of {:.3g} mm diameter is {:.3g} mm "
                             "long, the whole needle {} mm",
                             bevelAngle_rad(spec), 1e3 * spec.outer_diameter_m, 1e3 * std::max(behind, bevel),
                             numberText(1e3 * spec.length_m))};
  return {};
}

Status checkEffects(const pb::Profile& profile) {
  std::set<int> listed;
  for (int i = 0; i < profile.effects_size(); ++i) {
    const std::string& name = pb::Profile::Effect_Name(profile.effects(i));
    if (!listed.insert(profile.effects(i)).second) {
      return fieldError(fmt::format("effects[{}]", i), name + " is listed twice");
    }
  }
  // the section of each listed effect that has one
  for (const EffectEntry* effect : effectEntries()) {
    const bool is_listed = listed.contains(static_cast<int>(effect->effect) + 1);
    if (is_listed && !effect->section.empty() && sectionOf(*effect, profile) == nullptr)
      return fieldError(std::string(effect->section),
                        fmt::format("is missing, and effects lists {}", effect->name));
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

/// Checks a region that is a structure of the volume. `shape`: the first field of a shape that it also has;
/// empty: none.
Status checkStructure(const pb::Profile& profile, const std::string& id, const std::string& path,
                      const std::string& shape) {
  if (!profile.has_volume())
    return fieldError(path + ".structure", "needs a volume, and the profile has layers: give a shape");
  if (!shape.empty())
    return fieldError(path + "." + shape, "a region is either a structure or a shape: take one out");
  std::vector<std::string> ids;
  for (const auto& structure : profile.volume().structures()) ids.push_back(structure.id());
  if (std::ranges::find(ids, id) == ids.end())
    return fieldError(path + ".structure",
                      fmt::format("{} is not one of: {}", quotedText(id), fmt::join(ids, ", ")));
  return {};
}

/// Checks that the point to aim at is in the target's structure.
Status checkAim(const pb::Volume& volume, const pb::Target& target, const std::string& path) {
  ASSIGN_OR_RETURN(const Field field, fieldOf(volume));
  const StructureIndex found = field.at(vectorOf(target.center_m())).structure;
  if (found != kOutside && field.structures()[found].id == target.structure()) return {};
  return fieldError(path + ".center_m",
                    fmt::format("is {}, not in {}: give a point of the target's structure, or leave it out",
                                found == kOutside ? "outside of the skin"
                                                  : "in " + quotedText(field.structures()[found].id),
                                quotedText(target.structure())));
}

Status checkHazard(const pb::Profile& profile, const pb::Hazard& hazard, const std::string& path) {
  if (hazard.has_structure())
    return checkStructure(profile, hazard.structure(), path,
                          hazard.has_center_m()   ? "center_m"
                          : hazard.has_a_m()      ? "a_m"
                          : hazard.has_b_m()      ? "b_m"
                          : hazard.has_radius_m() ? "radius_m"
                          : hazard.has_anchor()   ? "anchor"
                                                  : "");
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

/// Checks that each name can be displayed, and that no two layers have the same name.
Status checkLayerNames(const pb::Profile& profile) {
  const std::vector<std::string> names = layerNames(profile);
  const auto layers = profileLayers(profile);
  const auto field = [&](std::size_t i) { return layerPath(profile, i) + ".name"; };
  const auto isNamed = [&](std::size_t i) { return layers[i]->has_name(); };
  std::map<std::string, std::size_t> called;  // the layer with that name
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const std::string& name = names[i];
    if (isNamed(i)) {
      RETURN_IF_ERROR(checkName(field(i), name));
    }
    // compare in lower case, because screens capitalise the first letter
    const auto [found, is_new] = called.try_emplace(lowerCase(name), i);
    if (is_new) continue;
    const bool exact = names[found->second] == name;
    // one of them was given this name; the other was, too, or gets it as a default
    const std::size_t named = isNamed(i) ? i : found->second, other = isNamed(i) ? found->second : i;
    const std::string where = layerPath(profile, other);
    const std::string why = isNamed(other) ? fmt::format(" is the name of {}, too", where)
                                           : fmt::format(" is what {} is called, which has no name", where);
    return fieldError(field(named), quotedText(names[named]) + why +
                                        (exact ? "" : "; capitals do not tell names apart") +
                                        ": give each layer a name of its own");
  }
  return {};
}

/// Checks the bone to find by feel.
Status checkLandmark(const pb::Profile& profile) {
  if (!profile.palpation().has_landmark()) return {};
  const std::string& id = profile.palpation().landmark();
  constexpr const char* kPath = "palpation.landmark";
  if (!profile.has_volume())
    return fieldError(kPath, "needs a volume, and the profile has layers, which have no landmark");
  std::vector<std::string> bones;
  for (const auto& structure : profile.volume().structures())
    if (tissueOf(structure) == pb::Layer::BONE) bones.push_back(structure.id());
  if (std::ranges::find(bones, id) != bones.end()) return {};
  return fieldError(kPath,
                    fmt::format("{} is not a bone of the volume: {}", quotedText(id),
                                bones.empty() ? "it has none" : fmt::format("{}", fmt::join(bones, ", "))));
}

/// Checks that each direction's name can be displayed.
Status checkDirections(const pb::Directions& directions) {
  const std::pair<const char*, const std::string*> all[] = {
      {"plus_x", &directions.plus_x()}, {"minus_x", &directions.minus_x()},
      {"plus_y", &directions.plus_y()}, {"minus_y", &directions.minus_y()},
      {"plus_z", &directions.plus_z()}, {"minus_z", &directions.minus_z()}};
  for (const auto& [field, name] : all)
    if (!name->empty()) RETURN_IF_ERROR(checkName(std::string("directions.") + field, *name));
  return {};
}

Status checkTargets(const pb::Profile& profile) {
  const std::vector<std::string> layers = layerNames(profile);
  std::set<std::string> names;
  for (int i = 0; i < profile.targets_size(); ++i) {
    const pb::Target& target = profile.targets(i);
    if (!names.insert(target.name()).second)
      return fieldError(fmt::format("targets[{}].name", i), quotedText(target.name()) + " is used twice");
    if (target.has_structure()) {
      const std::string path = fmt::format("targets[{}]", i);
      RETURN_IF_ERROR(checkStructure(profile, target.structure(), path,
                                     target.has_radius_m()        ? "radius_m"
                                     : target.tissues_size() != 0 ? "tissues"
                                     : target.has_anchor()        ? "anchor"
                                                                  : ""));
      if (target.has_center_m()) RETURN_IF_ERROR(checkAim(profile.volume(), target, path));
    }
    for (int k = 0; k < target.tissues_size(); ++k)
      if (std::ranges::find(layers, target.tissues(k)) == layers.end())
        return fieldError(fmt::format("targets[{}].tissues[{}]", i, k),
                          fmt::format("{} is not the name of a layer: {}", quotedText(target.tissues(k)),
                                      fmt::join(layers, ", ")));
  }
  return {};
}

/// A profile has either a volume, or a limb with layers.
Status checkBody(const pb::Profile& profile) {
  if (profile.has_volume()) {
    if (profile.has_limb())
      return fieldError("limb", "a profile with a volume has none: its skin is a group of the volume");
    if (profile.layers_size() > 0)
      return fieldError("layers", "a profile with a volume has none: they are the volume's structures");
    RETURN_IF_ERROR(checkVolume(profile.volume()));
  }
  const std::vector<Error> missing = missingParts(profile);
  if (!missing.empty()) return missing.front();
  return {};
}

}  // namespace

std::vector<Error> missingParts(const pb::Profile& profile) {
  std::vector<Error> faults;
  for (int i = 0; i < profile.targets_size(); ++i) {
    const pb::Target& target = profile.targets(i);
    if (target.has_structure()) continue;
    if (!target.has_center_m())
      faults.push_back(fieldError(fmt::format("targets[{}].center_m", i), "is missing"));
    if (!target.has_radius_m())
      faults.push_back(fieldError(fmt::format("targets[{}].radius_m", i), "is missing"));
  }
  for (int i = 0; i < profile.hazards_size(); ++i) {
    if (profile.hazards(i).has_structure()) continue;
    if (!profile.hazards(i).has_kind())
      faults.push_back(fieldError(fmt::format("hazards[{}].kind", i), "is missing"));
    if (!profile.hazards(i).has_radius_m())
      faults.push_back(fieldError(fmt::format("hazards[{}].radius_m", i), "is missing"));
  }
  for (int i = 0; i < profile.volume().structures_size(); ++i)
    if (const auto& structure = profile.volume().structures(i);
        !structure.has_kind() && !structure.layer().has_tissue())
      faults.push_back(fieldError(fmt::format("volume.structures[{}].layer.tissue", i),
                                  "is missing, and the structure has no kind"));
  if (profile.has_volume()) return faults;
  if (!profile.has_limb()) faults.push_back(fieldError("limb", "is missing"));
  if (profile.layers_size() == 0)
    faults.push_back(fieldError("layers", "is missing: give 1 to 32, from the skin inwards"));
  for (int i = 0; i < profile.layers_size(); ++i) {
    if (!profile.layers(i).has_tissue())
      faults.push_back(fieldError(fmt::format("layers[{}].tissue", i), "is missing"));
    if (!profile.layers(i).has_thickness_m())
      faults.push_back(fieldError(fmt::format("layers[{}].thickness_m", i), "is missing"));
  }
  return faults;
}

Status checkProfileRules(const pb::Profile& profile) {
  RETURN_IF_ERROR(checkId("id", profile.id()));
  RETURN_IF_ERROR(checkBody(profile));
  RETURN_IF_ERROR(checkNeedle(profile.needle()));
  RETURN_IF_ERROR(checkEffects(profile));
  RETURN_IF_ERROR(checkModelSection(profile));
  RETURN_IF_ERROR(checkStopMode(profile.tracking_wall()));
  RETURN_IF_ERROR(checkLayerNames(profile));
  RETURN_IF_ERROR(checkTargets(profile));
  RETURN_IF_ERROR(checkAnchors(profile));
  RETURN_IF_ERROR(checkLandmark(profile));
  RETURN_IF_ERROR(checkDirections(profile.directions()));
  std::set<std::string> names;
  for (int i = 0; i < profile.hazards_size(); ++i) {
    const std::string path = fmt::format("hazards[{}]", i);
    RETURN_IF_ERROR(checkHazard(profile, profile.hazards(i), path));
    if (!names.insert(profile.hazards(i).name()).second) {
      return fieldError(path + ".name", quotedText(profile.hazards(i).name()) + " is used twice");
    }
  }
  // forces and shapes are checked in one place, the engine
  if (const auto spec = sceneSpecOf(profile); !spec) return spec.error();
  return {};
}

Status checkExerciseRules(const pb::Exercise& exercise, const std::string& path) {
  const std::string prefix = path.empty() ? "" : path + ".";
  RETURN_IF_ERROR(checkId(prefix + "id", exercise.id()));
  RETURN_IF_ERROR(checkId(prefix + "profile_id", exercise.profile_id()));
  if (exercise.has_needle()) {
    if (Status status = checkNeedle(exercise.needle()); !status)
      return Error{status.error().code, prefix + status.error().message};
  }
  RETURN_IF_ERROR(checkAids(prefix + "aids.allowed", exercise.aids().allowed()));
  if (exercise.has_plan()) RETURN_IF_ERROR(checkPlanFields(exercise.plan(), prefix + "plan"));
  if (exercise.has_due_unix_ms()) RETURN_IF_ERROR(checkWhole(prefix + "due_unix_ms", exercise.due_unix_ms()));
  for (int i = 0; i < exercise.requirements_size(); ++i) {
    const auto& requirement = exercise.requirements(i);
    const std::string where = prefix + fmt::format("requirements[{}]", i);
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

/// A course's exercises and their prerequisites.
class Prerequisites {
 public:
  explicit Prerequisites(const pb::Curriculum& curriculum) : exercises_(curriculum.exercises()) {
    for (int i = 0; i < exercises_.size(); ++i) index_[exercises_[i].id()] = i;
    state_.resize(static_cast<std::size_t>(exercises_.size()), State::kNew);
  }

  /// Checks that all prerequisites are exercises of this course, each listed once, never the exercise itself,
  /// and without cycles.
  Status check() {
    for (int i = 0; i < exercises_.size(); ++i) {
      std::set<std::string> named;
      for (int j = 0; j < exercises_[i].prerequisites_size(); ++j) {
        const std::string& id = exercises_[i].prerequisites(j);
        const std::string path = fmt::format("exercises[{}].prerequisites[{}]", i, j);
        if (!index_.contains(id))
          return fieldError(path, quotedText(id) + " is not an exercise of this course");
        if (!named.insert(id).second) return fieldError(path, quotedText(id) + " is named twice");
      }
    }
    for (int i = 0; i < exercises_.size(); ++i) RETURN_IF_ERROR(visit(i));
    return {};
  }

 private:
  enum class State { kNew, kOnTheWay, kDone };

  /// Not recursive: a course may have a thousand exercises in one chain.
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
      // the cycle, from the exercise where it was entered back to it
      std::string circle;
      bool inside = false;
      for (const Step& on_way : way) {
        inside = inside || on_way.exercise == next;
        if (inside) circle += quotedText(exercises_[on_way.exercise].id()) + " needs ";
      }
      return fieldError(
          fmt::format("exercises[{}].prerequisites", way.back().exercise),
          "form a cycle, so none of these can ever begin: " + circle + quotedText(exercises_[next].id()));
    }
    return {};
  }

  const google::protobuf::RepeatedPtrField<pb::Exercise>& exercises_;
  std::map<std::string, int> index_;
  std::vector<State> state_;
};

}  // namespace

Status checkCurriculumRules(const pb::Curriculum& curriculum) {
  RETURN_IF_ERROR(checkId("id", curriculum.id()));
  if (curriculum.has_results_from_unix_ms()) {
    RETURN_IF_ERROR(checkWhole("results_from_unix_ms", curriculum.results_from_unix_ms()));
    if (!curriculum.exam()) return fieldError("results_from_unix_ms", "is for an exam, and exam is not true");
  }
  std::set<std::string> ids;
  for (int i = 0; i < curriculum.exercises_size(); ++i) {
    const std::string path = fmt::format("exercises[{}]", i);
    RETURN_IF_ERROR(checkExerciseRules(curriculum.exercises(i), path));
    if (!ids.insert(curriculum.exercises(i).id()).second) {
      return fieldError(path + ".id", quotedText(curriculum.exercises(i).id()) + " is used twice");
    }
  }
  return Prerequisites(curriculum).check();
}

}  // namespace needlelab
