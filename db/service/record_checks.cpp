#include "db/service/record_tables.h"

#include <fmt/core.h>
#include <cmath>
#include <limits>

#include "common/base/text.h"
#include "common/base/uuid.h"
#include "common/profile/strict_json.h"
#include "common/scoring/measures.h"
#include "db/lab_settings.h"
#include "db/people.h"
#include "db/pseudonyms.h"
#include "db/service/lesson_texts.h"
#include "proto/session_rules.h"

namespace needlelab {
namespace {

/// Far beyond any recording; 4 bytes of CRC per chunk are stored.
constexpr std::int64_t kMostChunksOfRecord = 1 << 22;
/// The greatest number of a row (audit, assignment, consent, annotation): SQLite numbers on from the
/// greatest, and what reads exports as JSON knows whole numbers up to here.
constexpr std::int64_t kGreatestId = std::int64_t{1} << 53;

Error wrongField(std::string_view name, const std::string& text) {
  return {ErrorCode::kInvalidInput, std::string(name) + ": " + text};
}

Status checkInteger(std::string_view name, const RecordJson& value) {
  if (!value.is_number_integer() || (value.is_number_unsigned() && value.get<std::uint64_t>() > INT64_MAX))
    return wrongField(name, "must be a whole number of 64 bits");
  const auto number = value.get<std::int64_t>();
  // the clock offset may be negative; outside of all layers the layer is -1
  if (number < 0 && name != "clock_offset_ns" && !name.ends_with("_layer"))
    return wrongField(name, fmt::format("is {}, must not be negative", number));
  if (name == "id" && number > kGreatestId)
    return wrongField(name, fmt::format("is {}, must not be above {}: new rows are numbered on from it",
                                        number, kGreatestId));
  const bool is_short = name.ends_with("revision") || name == "definition_version";
  if (is_short && number > std::numeric_limits<std::uint32_t>::max())
    return wrongField(name, fmt::format("is {}, has no more than 32 bits", number));
  return {};
}

Status checkColumn(const RecordColumn& column, const RecordJson& value) {
  switch (column.kind) {
    case RecordColumnKind::kInteger:
    case RecordColumnKind::kCounter:
    case RecordColumnKind::kMark:
      return checkInteger(column.name, value);
    case RecordColumnKind::kReal:
      if (!value.is_number() || !std::isfinite(value.get<double>()))
        return wrongField(column.name, "must be a number");
      return {};
    case RecordColumnKind::kText:
      if (!value.is_string()) return wrongField(column.name, "must be a text");
      if (!isUtf8(value.get_ref<const std::string&>()))
        return wrongField(column.name, "is no text of UTF-8 without zeros");
      return {};
    case RecordColumnKind::kHex:
    case RecordColumnKind::kSession:
      break;
  }
  if (!value.is_string()) return wrongField(column.name, "must be a text of hexadecimal digits");
  const auto bytes = bytesOfHex(value.get_ref<const std::string&>());
  if (!bytes) return wrongField(column.name, bytes.error().message);
  const std::size_t wanted = column.kind == RecordColumnKind::kSession || column.name == "id" ? 16
                             : column.name == "description"                                   ? bytes->size()
                                                                                              : 32;
  if (bytes->size() != wanted)
    return wrongField(column.name, fmt::format("has {} bytes, must have {}", bytes->size(), wanted));
  return {};
}

Status checkProfileRecord(const RecordJson& record) {
  ASSIGN_OR_RETURN(const auto profile, storedProfileOf(textIn(record, "json"), "json", "", 0));
  if (profile.id == textIn(record, "id") && profile.json == textIn(record, "json")) return {};
  return wrongField("json", "is not canonical, or has another id");
}

Status checkCourseRecord(const RecordJson& record) {
  ASSIGN_OR_RETURN(const auto course, storedCurriculumOf(textIn(record, "json"), "json", "", 0));
  if (course.id == textIn(record, "id") && course.json == textIn(record, "json")) return {};
  return wrongField("json", "is not canonical, or has another id");
}

/// Checks the rows of a score.
Status checkMeasures(const char* field, const std::string& json) {
  if (parseScore(json)) return {};
  return wrongField(field, "is no list of measures: objects with \"measure\", a text, and \"value\"");
}

Status checkSessionRecord(const RecordJson& record) {
  const auto bytes = bytesOfHex(textIn(record, "description"));
  pb::SessionDescription d;
  if (!bytes || !d.ParseFromString(*bytes))
    return wrongField("description", "is no description of a session");
  const auto same = [&](const char* name, bool equal) {
    return equal ? Status() : Status(wrongField(name, "is not what the description says"));
  };
  for (const auto& checked :
       {same("id", hexDigitsOf(d.session_id()) == textIn(record, "id")),
        same("station", d.station() == textIn(record, "station")),
        same("trainee", d.trainee() == textIn(record, "trainee")),
        same("exercise_id", d.exercise_id() == textIn(record, "exercise_id")),
        same("profile_id", d.profile_id() == textIn(record, "profile_id")),
        same("profile_revision",
             static_cast<std::int64_t>(d.profile_revision()) == numberIn(record, "profile_revision")),
        same("started_unix_ns", d.started_unix_ns() == numberIn(record, "started_unix_ns"))}) {
    if (!checked) return checked;
  }
  d.set_profile_json(textIn(record, "profile_json"));
  if (auto valid = checkDescription(d); !valid) return wrongField("description", valid.error().message);
  if (numberIn(record, "chunks") > kMostChunksOfRecord)
    return wrongField("chunks", fmt::format("more than {}", kMostChunksOfRecord));
  const std::int64_t state = numberIn(record, "state");
  if (state != pb::SESSION_COMPLETE && state != pb::SESSION_INTERRUPTED)
    return wrongField("state", fmt::format("is {}{}", state,
                                           (state == pb::SESSION_OPEN
                                                ? ", an open session: only closed ones can be imported"
                                                : ", which is no state of a closed session")));
  return isGiven(record, "score_json") ? checkMeasures("score_json", textIn(record, "score_json")) : Status();
}

Status checkScoreRecord(const RecordJson& record) {
  RETURN_IF_ERROR(checkMeasures("measures", textIn(record, "measures")));
  const std::int64_t version = numberIn(record, "definition_version");
  if (version <= kScoreDefinitionVersion) return {};
  return wrongField("definition_version",
                    fmt::format("is {}, this program knows definitions up to {}: update it first", version,
                                kScoreDefinitionVersion));
}

Status checkReferenceRecord(const RecordJson& record) {
  const auto ids = readShallowJson<RecordJson>(textIn(record, "sessions"));
  if (!ids.is_array()) return wrongField("sessions", "is no list of sessions");
  for (const auto& id : ids) {
    if (!id.is_string() || id.get_ref<const std::string&>().size() > 36)
      return wrongField("sessions", "is no list of sessions' ids");
  }
  return {};
}

/// Other rows of `meta` are facts about this database.
Status checkSettingRecord(const RecordJson& record) {
  if (textIn(record, "key") != kCodesRequiredKey)
    return wrongField(
        "key", fmt::format("is '{}', allowed is {}", printable(textIn(record, "key")), kCodesRequiredKey));
  const std::string value = textIn(record, "value");
  return value == "0" || value == "1" ? Status() : Status(wrongField("value", "allowed are 0 and 1"));
}

}  // namespace

Status checkFields(const RecordTable& table, const RecordJson& record) {
  for (const RecordColumn& column : table.columns) {
    const auto value = record.find(fieldOf(column));
    if (value == record.end() || value->is_null()) continue;  // the schema knows the required fields
    RETURN_IF_ERROR(checkColumn(column, *value));
  }
  return {};
}

Status checkRecord(const RecordTable& table, const RecordJson& record) {
  if (table.kind == "person") {
    RETURN_IF_ERROR(checkNotReserved("name", textIn(record, "name")));
    RETURN_IF_ERROR(checkNewText("full_name", textIn(record, "full_name"), 0, 200));
    RETURN_IF_ERROR(checkText("password_hash", textIn(record, "password_hash"), 0, 200));
    RETURN_IF_ERROR(checkText("code_hash", textIn(record, "code_hash"), 0, 200));
  }
  // the names themselves are as they were: sessions have them, and nobody can change them
  if (table.kind == "person" || table.kind == "station") return checkName("name", textIn(record, "name"));
  if (table.kind == "group") {
    RETURN_IF_ERROR(checkName("id", textIn(record, "id")));
    return checkNewText("name", textIn(record, "name"), 1, 200);
  }
  if (table.kind == "lab_setting") return checkSettingRecord(record);
  if (table.kind == "consent") return checkText("note", textIn(record, "note"), 0, 1000);
  if (table.kind == "profile") return checkProfileRecord(record);
  if (table.kind == "course") return checkCourseRecord(record);
  if (table.kind == "session") return checkSessionRecord(record);
  if (table.kind == "unknown_trainee") return checkName("given", textIn(record, "given"));
  if (table.kind == "score") return checkScoreRecord(record);
  if (table.kind == "reference") return checkReferenceRecord(record);
  return {};
}

}  // namespace needlelab
