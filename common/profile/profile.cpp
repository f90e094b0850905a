#include "common/profile/profile.h"

#include <algorithm>
#include <string>
#include <utility>

#include "common/base/files/files.h"
#include "common/base/text/strict_json.h"
#include "common/profile/message_json.h"
#include "common/profile/rules.h"

namespace needlelab {
namespace {

/// Converts text to a checked message: parses JSON, then checks the limits of single fields, then the rules
/// across fields.
template <typename T, typename Rules>
Result<T> parse(std::string_view text, std::string_view source, Rules rules) {
  ASSIGN_OR_RETURN(const nlohmann::json tree, readStrictJson(text, source, kMaxProfileBytes));
  T message;
  Status status = readMessage(tree, message);
  if (status) status = rules(message);
  if (!status) return Error{status.error().code, std::string(source) + ": " + status.error().message};
  return message;
}

}  // namespace

Result<pb::Profile> parseProfile(std::string_view json, std::string_view source) {
  return parse<pb::Profile>(json, source, checkProfileRules);
}

Result<pb::Profile> loadProfile(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const std::string text, readWholeFile(path, kMaxProfileBytes));
  return parseProfile(text, path.string());
}

std::vector<Error> profileFaults(std::string_view json) {
  const auto tree = readStrictJson(json, "profile", kMaxProfileBytes);
  if (!tree) return {tree.error()};
  pb::Profile profile;
  std::vector<Error> faults = messageFaults(*tree, profile);
  // a field with a wrong value is not missing
  for (Error& missing : missingParts(profile)) {
    const std::string path = missing.message.substr(0, missing.message.find(':') + 1);
    const bool is_named = std::any_of(faults.begin(), faults.end(),
                                      [&](const Error& fault) { return fault.message.starts_with(path); });
    if (!is_named) faults.push_back(std::move(missing));
  }
  if (!faults.empty()) return faults;
  if (Status status = checkProfileRules(profile); !status) faults.push_back(status.error());
  return faults;
}

std::string profileJson(const pb::Profile& profile) {
  return writeMessage(profile);
}

Result<pb::Exercise> parseExercise(std::string_view json, std::string_view source) {
  return parse<pb::Exercise>(json, source, [](const pb::Exercise& e) { return checkExerciseRules(e, ""); });
}

std::string exerciseJson(const pb::Exercise& exercise) {
  return writeMessage(exercise);
}

bool isAssignedOnly(const pb::Curriculum& course) {
  return course.assigned_only() || course.exam();
}

pb::Exercise exerciseInCourse(const pb::Curriculum& course, pb::Exercise exercise) {
  if (!course.exam()) return exercise;
  if (!exercise.has_attempts()) exercise.set_attempts(1);
  if (!exercise.has_aids()) exercise.mutable_aids();
  return exercise;
}

Result<pb::Curriculum> parseCurriculum(std::string_view json, std::string_view source) {
  return parse<pb::Curriculum>(json, source, checkCurriculumRules);
}

Result<pb::Curriculum> loadCurriculum(const std::filesystem::path& path) {
  ASSIGN_OR_RETURN(const std::string text, readWholeFile(path, kMaxProfileBytes));
  return parseCurriculum(text, path.string());
}

std::string curriculumJson(const pb::Curriculum& curriculum) {
  return writeMessage(curriculum);
}

}  // namespace needlelab
