/// Profiles, exercises and curricula: strict JSON in, canonical JSON out, and the scene that a profile
/// describes (db/samples/README.md, "Profile fields"). Ranges, required fields and sizes stand beside the
/// fields in proto/needlelab/profile.proto and are read from there.
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

/// Reads and checks a whole profile. `source` names the text in messages, e.g. the file's name.
/// Field names may be in snake_case or lowerCamelCase. Errors: kInvalidInput, e.g.
/// `knee.json: layers[2].cutting_force_n: 75 is out of range [0, 50]`; the first fault only.
Result<pb::Profile> parseProfile(std::string_view json, std::string_view source);
/// The same from a file, named by its path in messages.
Result<pb::Profile> loadProfile(const std::filesystem::path& path);
/// All faults of a profile, not only the first: for an author who is still writing.
/// Each fault begins with its path where it has one, `layers[2].cutting_force_n: …`. What binds several
/// fields is looked at once the fields are right by themselves, and stops at its first fault. Empty:
/// parseProfile takes the text.
std::vector<Error> profileFaults(std::string_view json);
/// Canonical JSON: snake_case, fields in the order of the .proto, shortest numbers, a newline at the end.
/// The same profile gives the same bytes, and `parseProfile(profileJson(p))` gives p back.
std::string profileJson(const pb::Profile& profile);

/// A profile's needle as numbers: `outer_diameter_m` as given, else the gauge's; 0 where neither is.
NeedleSpec needleOf(const pb::Needle& needle);

/// The scene for the engine, with the limb placed in W by `X_WL` (L: the frame of the profile's coordinates).
/// Errors: kInvalidInput, when the profile (one that did not come from `parseProfile`) or the placement is
/// not valid.
Result<SceneSpec> sceneSpecOf(const pb::Profile& profile, const Pose& X_WL = {});

/// Another axial model in place of the profile's own, by name, as on the command line. Where the profile has
/// no section of that model it gets one with the defaults of FORCE_MODEL.md, "Axial models", if each field
/// has one. Errors: kInvalidInput for an unknown name and for a section that is missing; the profile may be
/// changed then.
Status chooseModel(pb::Profile& profile, const std::string& name);

/// Writes the scene's axial model, that model's section and the list of effects into a profile of the same
/// layers (`sceneSpecOf` reads them back the same; a seed keeps its lowest 32 bits).
void putModel(const SceneSpec& spec, pb::Profile& profile);

/// How well a layer of this thickness can be felt, 0 to 1: the share of it that is left once the wall's
/// spring has come within 10 % (taken as the just noticeable difference, an assumption) of the layer's
/// cutting force; `φ = max(0, 1 − (Δf − 0.1 f)/(K_t·thickness))`, at most 1. 1 where the force does not rise.
double fidelity(double force_before_N, double force_N, double wall_stiffness_N_per_m, double thickness_m);

/// What a valid profile's author should know, one sentence each, with the numbers: membranes that rupture
/// deeper than their layer is thick, layers too thin to be felt by a wall (φ < 0.5), listed effects that the
/// axial model does not have, numbers without data behind them. Empty when there is nothing to say.
std::vector<std::string> profileWarnings(const pb::Profile& profile);

/// As for profiles. The exercises of a curriculum have different ids; a requirement has min, max or both.
Result<pb::Exercise> parseExercise(std::string_view json, std::string_view source);
std::string exerciseJson(const pb::Exercise& exercise);
Result<pb::Curriculum> parseCurriculum(std::string_view json, std::string_view source);
Result<pb::Curriculum> loadCurriculum(const std::filesystem::path& path);
std::string curriculumJson(const pb::Curriculum& curriculum);

}  // namespace needlelab
