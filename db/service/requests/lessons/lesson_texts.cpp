#include "db/service/requests/lessons/lesson_texts.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "common/base/text/strict_json.h"
#include "common/profile/profile.h"
#include "common/scoring/measures/measures.h"
#include "db/store/schema.h"

namespace needlelab {
namespace {

/// The author of the samples in a new database.
constexpr const char* kSampleAuthor = "needlelab";

/// Reads the `id` and `name` of a document, and no further.
class IdAndName final : public nlohmann::json_sax<nlohmann::json> {
 public:
  std::string id, name;

  bool null() override { return true; }
  bool boolean(bool /*value*/) override { return true; }
  bool number_integer(number_integer_t /*value*/) override { return true; }
  bool number_unsigned(number_unsigned_t /*value*/) override { return true; }
  bool number_float(number_float_t /*value*/, const string_t& /*text*/) override { return true; }
  bool binary(binary_t& /*value*/) override { return false; }
  bool start_object(std::size_t /*size*/) override { return ++depth_ > 0; }
  bool start_array(std::size_t /*size*/) override { return ++depth_ > 0; }
  bool end_object() override { return --depth_ >= 0; }
  bool end_array() override { return --depth_ >= 0; }
  bool key(string_t& key) override {
    field_ = depth_ > 1 ? nullptr : key == "id" ? &id : key == "name" ? &name : nullptr;
    return true;
  }
  bool string(string_t& value) override {
    if (field_ != nullptr) *std::exchange(field_, nullptr) = value;
    return id.empty() || name.empty();
  }
  bool parse_error(std::size_t /*position*/, const std::string& /*token*/,
                   const nlohmann::json::exception& /*error*/) override {
    return false;
  }

 private:
  int depth_ = 0;
  std::string* field_ = nullptr;
};

/// A sample as it would be stored, if it were imported: samples are valid and canonical
/// (tests/unit/common/profile), so they are not parsed again in every new database.
StoredProfile sampleProfile(std::string_view json, std::int64_t now_unix_ns) {
  IdAndName read;
  nlohmann::json::sax_parse(json, &read, nlohmann::json::input_format_t::json, false);
  return {read.id, 0, read.name, std::string(json), kSampleAuthor, now_unix_ns};
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
      if (file.name.ends_with("curriculum.json") != curricula) continue;
      if (curricula) {
        ASSIGN_OR_RETURN(const auto curriculum,
                         storedCurriculumOf(file.text, "db/samples/" + std::string(file.name), kSampleAuthor,
                                            now_unix_ns));
        RETURN_IF_ERROR(CurriculumStore(writer).put(curriculum));
      } else {
        RETURN_IF_ERROR(ProfileStore(writer).put(sampleProfile(file.text, now_unix_ns)));
      }
    }
  }
  return {};
}

}  // namespace needlelab
