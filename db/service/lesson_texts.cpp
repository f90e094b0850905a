#include "db/service/lesson_texts.h"

#include <nlohmann/json.hpp>

#include "common/profile/profile.h"
#include "common/scoring/measures.h"
#include "db/schema.h"

namespace needlelab {
namespace {

bool isCurriculum(std::string_view json) {
  const auto value = nlohmann::json::parse(json, nullptr, false);
  return value.is_object() && value.contains("exercises");
}

}  // namespace

Result<StoredProfile> storedProfileOf(std::string_view json, std::string_view source,
                                      const std::string& author, std::int64_t now_unix_ns) {
  const auto profile = parseProfile(json, source);
  if (!profile) return profile.error();
  return StoredProfile{profile->id(), 0, profile->name(), profileJson(*profile), author, now_unix_ns};
}

Result<StoredCurriculum> storedCurriculumOf(std::string_view json, std::string_view source,
                                            const std::string& author, std::int64_t now_unix_ns) {
  const auto curriculum = parseCurriculum(json, source);
  if (!curriculum) return curriculum.error();
  StoredCurriculum stored{curriculum->id(), 0, curriculum->name(), curriculumJson(*curriculum), author,
                          now_unix_ns,      {}};
  for (const pb::Exercise& exercise : curriculum->exercises()) {
    if (const auto known = checkRequirements(exercise); !known) {
      return Error{known.error().code,
                   std::string(source) + ": exercise '" + exercise.id() + "': " + known.error().message};
    }
    stored.exercises.push_back(
        {exercise.id(), curriculum->id(), exercise.name(), exercise.profile_id(), exerciseJson(exercise)});
  }
  return stored;
}

std::string changedFields(std::string_view before, std::string_view after) {
  const auto was = nlohmann::json::parse(before, nullptr, false),
             is = nlohmann::json::parse(after, nullptr, false);
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
  auto profile = parseProfile(profile_json, source);
  if (!profile) return profile.error();
  *profile->mutable_needle() = exercise.needle();
  std::string json = profileJson(*profile);
  // the two of them must make a scene
  if (const auto checked = parseProfile(json, source); !checked) return checked.error();
  return json;
}

Status storeSamples(Connection& writer, std::int64_t now_unix_ns) {
  // profiles first: exercises refer to them
  for (const bool curricula : {false, true}) {
    for (const EmbeddedFile& file : embeddedSamples()) {
      if (isCurriculum(file.text) != curricula) continue;
      const std::string source = "db/samples/" + std::string(file.name);
      if (curricula) {
        const auto curriculum = storedCurriculumOf(file.text, source, kSampleAuthor, now_unix_ns);
        if (!curriculum) return curriculum.error();
        if (const auto put = CurriculumStore(writer).put(*curriculum); !put) return put.error();
      } else {
        const auto profile = storedProfileOf(file.text, source, kSampleAuthor, now_unix_ns);
        if (!profile) return profile.error();
        if (const auto put = ProfileStore(writer).put(*profile); !put) return put.error();
      }
    }
  }
  return {};
}

}  // namespace needlelab
