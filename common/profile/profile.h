/// Profiles, exercises and curricula: strict JSON in, canonical JSON out (db/samples/README.md, "Profile
/// fields"). Ranges, required fields and sizes are read from the options of the fields in
/// proto/needlelab/profile.proto.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Larger profiles and curricula are refused without parsing.
inline constexpr std::size_t kMaxProfileBytes = 1u << 20;

/// Reads and checks a profile. `source` names the text in messages, e.g. the file's name.
/// Field names may be in snake_case or lowerCamelCase. Errors: kInvalidInput, e.g.
/// `knee.json: layers[2].cutting_force_n: 75 is out of range [0, 50]`; the first fault only.
Result<pb::Profile> parseProfile(std::string_view json, std::string_view source);
/// Reads and checks a profile file; messages name its path.
Result<pb::Profile> loadProfile(const std::filesystem::path& path);
/// Returns all faults of a profile, not only the first, for an author. Each fault begins with its path if it
/// has one, `layers[2].cutting_force_n: …`. Rules across fields are checked only when all single fields are
/// valid, and only their first fault is returned. Empty if parseProfile accepts the text.
std::vector<Error> profileFaults(std::string_view json);
/// Canonical JSON: snake_case, fields in the order of the .proto, shortest numbers, a newline at the end.
/// The same profile gives the same bytes, and `parseProfile(profileJson(p))` gives p back.
std::string profileJson(const pb::Profile& profile);

/// As for profiles. The exercises of a curriculum must have different ids; a requirement must have min, max
/// or both; a plan must be a line (planned_line.h also checks it with the profile); only an exam may hold
/// back its results.
Result<pb::Exercise> parseExercise(std::string_view json, std::string_view source);
std::string exerciseJson(const pb::Exercise& exercise);
/// Whether only trainees to whom the course is assigned can see and begin it: true if it says so or is an
/// exam.
bool isAssignedOnly(const pb::Curriculum& course);
/// The exercise as practised in this course: in an exam, it defaults to one attempt and no aids.
pb::Exercise exerciseInCourse(const pb::Curriculum& course, pb::Exercise exercise);
Result<pb::Curriculum> parseCurriculum(std::string_view json, std::string_view source);
Result<pb::Curriculum> loadCurriculum(const std::filesystem::path& path);
std::string curriculumJson(const pb::Curriculum& curriculum);

}  // namespace needlelab
