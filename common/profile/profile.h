/// Profiles, exercises and curricula: strict JSON in, canonical JSON out, and the scene that a profile
/// describes (db/samples/README.md, "Profile fields"). Ranges, required fields and sizes are read from the
/// options of the fields in proto/needlelab/profile.proto.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/haptics/needle_spec.h"
#include "common/haptics/scene_spec.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Profiles and curricula larger than this are refused unread.
inline constexpr std::size_t kMaxProfileBytes = 1u << 20;

/// Reads and checks a profile. `source` names the text in messages, e.g. the file's name.
/// Field names may be in snake_case or lowerCamelCase. Errors: kInvalidInput, e.g.
/// `knee.json: layers[2].cutting_force_n: 75 is out of range [0, 50]`; the first fault only.
Result<pb::Profile> parseProfile(std::string_view json, std::string_view source);
/// Reads and checks a profile file; messages name its path.
Result<pb::Profile> loadProfile(const std::filesystem::path& path);
/// Returns all faults of a profile, not only the first, for an author at work. Each fault begins with its
/// path if it has one, `layers[2].cutting_force_n: …`. Rules over several fields are checked only when the
/// single fields are valid, and only their first fault is returned. Empty: parseProfile accepts the text.
std::vector<Error> profileFaults(std::string_view json);
/// Canonical JSON: snake_case, fields in the order of the .proto, shortest numbers, a newline at the end.
/// The same profile gives the same bytes, and `parseProfile(profileJson(p))` gives p back.
std::string profileJson(const pb::Profile& profile);

/// The skin's surface in the profile's frame, a plane's normal of length 1. Errors: kInvalidInput without a
/// shape.
Result<Limb> unitLimbOf(const pb::Limb& limb);

/// A profile's needle as numbers: `outer_diameter_m` as given, else from the gauge; 0 if neither is given.
NeedleSpec needleOf(const pb::Needle& needle);

/// The scene for the engine, with the limb placed in W by `X_WL` (L: the frame of the profile's coordinates).
/// Errors: kInvalidInput, when the profile (one that did not come from `parseProfile`) or the placement is
/// not valid.
Result<SceneSpec> sceneSpecOf(const pb::Profile& profile, const Pose& X_WL = {});

/// Another axial model in place of the profile's own, by name, as on the command line. If the profile has no
/// section for that model, it gets one with the defaults of FORCE_MODEL.md, "Axial models", provided each
/// field has a default. Errors: kInvalidInput for an unknown name and for a missing section; the profile may
/// then be modified.
Status chooseModel(pb::Profile& profile, const std::string& name);

/// Writes the scene's axial model, that model's section and the list of effects into a profile of the same
/// layers (`sceneSpecOf` reads the same values back; a seed keeps its lowest 32 bits).
void putModel(const SceneSpec& spec, pb::Profile& profile);

/// How well a layer of this thickness can be felt, 0 to 1: the share of the layer that remains after the
/// wall's spring has come within 10 % of the layer's cutting force (10 % is the assumed just noticeable
/// difference); `φ = max(0, 1 − (Δf − 0.1 f)/(K_t·thickness))`, at most 1. 1 where the force does not rise.
double fidelity(double force_before_N, double force_N, double wall_stiffness_N_per_m, double thickness_m);

/// Returns warnings for the author of a valid profile, one sentence each, with the numbers: membranes that
/// rupture deeper than their layer is thick, layers too thin to feel with a wall (φ < 0.5), listed effects
/// that the axial model does not have, numbers without supporting data. May be empty.
std::vector<std::string> profileWarnings(const pb::Profile& profile);

/// As for profiles. The exercises of a curriculum must have different ids; a requirement must have min, max
/// or both; a plan must be a line (planned_line.h also checks it with the profile); only an exam holds its
/// results back.
Result<pb::Exercise> parseExercise(std::string_view json, std::string_view source);
std::string exerciseJson(const pb::Exercise& exercise);
/// Whether only those see and begin the course to whom it is assigned: it says so, or is an exam.
bool isAssignedOnly(const pb::Curriculum& course);
/// An exercise as it is practised in this course: an exam adds one attempt and no aids where it says nothing
/// of them.
pb::Exercise exerciseInCourse(const pb::Curriculum& course, pb::Exercise exercise);
Result<pb::Curriculum> parseCurriculum(std::string_view json, std::string_view source);
Result<pb::Curriculum> loadCurriculum(const std::filesystem::path& path);
std::string curriculumJson(const pb::Curriculum& curriculum);

}  // namespace needlelab
