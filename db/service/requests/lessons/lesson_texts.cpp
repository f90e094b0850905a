#include "db/service/requests/lessons/lesson_texts.h"

#include <nlohmann/json.hpp>

#include "common/profile/profile.h"
#include "common/profile/strict_json.h"
#include "common/scoring/measures/measures.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

/// The author of the samples in a new database.
constexpr const char* kSampleAuthor = "needlelab";

bool isCurriculum(std::string_view json) {
  const auto value = readShallowJson<nlohmann::json>(json);
  return value.is_object() && value.contains("exercises");
}

}  // namespace

Result<StoredProfile> storedProfileOf(std::string_view json, std::string_view source,
                                      const std::string& author, std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto profile, parseProfile(json, source));
  return StoredProfile{profile.id(), 0, profile.name(), profileJson(profile), author, now_unix_ns};
}

Result<StoredCurriculum> storedCurriculumOf(std::string_view json, std::string_view source,
                                            const std::string& author, std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto curriculum, parseCurriculum(json, source));
  StoredCurriculum stored{curriculum.id(), 0, curriculum.name(), curriculumJson(curriculum), author,
                          now_unix_ns,     {}};
  for (const pb::Exercise& given : curriculum.exercises()) {
    const pb::Exercise exercise = exerciseInCourse(curriculum, given);
    if (const auto known = checkRequirements(exercise); !known) {
      return Error{known.error().code,
                   std::string(source) + ": exercise '" + exercise.id() + "': " + known.error().message};
    }
    CourseRules rules{isAssignedOnly(curriculum), std::nullopt,
                      static_cast<std::int64_t>(curriculum.results_from_unix_ms()) * 1'000'000};
    if (curriculum.exam()) rules.exam_attempts = exercise.attempts();
    stored.exercises.push_back({exercise.id(), curriculum.id(), exercise.name(), exercise.profile_id(),
                                exerciseJson(exercise), rules});
  }
  return stored;
}

std::string changedFields(std::string_view before, std::string_view after) {
  const auto was = readShallowJson<nlohmann::json>(before), is = readShallowJson<nlohmann::json>(after);
  if (!was.is_object() || !is.is_object()) return {};
  std::string names;
  const auto add = [&](const std::string& name) { names += (names.empty() ? ": " : ", ") + name; };
  for (const auto& [name, value] : is.items())
    if (!was.contains(name) || was[name] != value) add(name);
  for (const auto& [name, value] : was.items())
    if (!is.contains(name)) add(name);
  return names;
}

Result<std::string> profileWithNeedle(const std::string& profile_json, const pb::Exercise& exercise) {
  const std::string source =
      "exercise '" + exercise.id() + "', its needle in profile '" + exercise.profile_id() + "'";
  ASSIGN_OR_RETURN(auto profile, parseProfile(profile_json, source));
  *profile.mutable_needle() = exercise.needle();
  std::string json = profileJson(profile);
  // needle and profile must fit together
  RETURN_IF_ERROR(parseProfile(json, source));
  return json;
}

Status storeSamples(Connection& writer, std::int64_t now_unix_ns) {
  // profiles first: exercises refer to them
  for (const bool curricula : {false, true}) {
    for (const EmbeddedFile& file : embeddedSamples()) {
      if (isCurriculum(file.text) != curricula) continue;
      const std::string source = "db/samples/" + std::string(file.name);
      if (curricula) {
        ASSIGN_OR_RETURN(const auto curriculum,
                         storedCurriculumOf(file.text, source, kSampleAuthor, now_unix_ns));
        RETURN_IF_ERROR(CurriculumStore(writer).put(curriculum));
      } else {
        ASSIGN_OR_RETURN(const auto profile, storedProfileOf(file.text, source, kSampleAuthor, now_unix_ns));
        RETURN_IF_ERROR(ProfileStore(writer).put(profile));
      }
    }
  }
  return {};
}

}  // namespace needlelab
