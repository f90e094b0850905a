#include "db/service/record_tables.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "db/credentials.h"
#include "db/erasure.h"
#include "db/pseudonyms.h"

namespace needlelab {
namespace {

using K = RecordColumnKind;

constexpr std::array kPersonColumns = {RecordColumn{"name", K::kText, true},
                                       RecordColumn{"role", K::kInteger},
                                       RecordColumn{"password_hash", K::kText, false, true},
                                       RecordColumn{"disabled", K::kInteger},
                                       RecordColumn{"created_unix_ns", K::kInteger},
                                       RecordColumn{"full_name"},
                                       RecordColumn{"revision", K::kInteger},
                                       RecordColumn{"changed_unix_ns", K::kInteger},
                                       RecordColumn{"changed_by"},
                                       RecordColumn{"code_hash", K::kText, false, true, "null"}};
constexpr std::array kGroupColumns = {
    RecordColumn{"id", K::kText, true},           RecordColumn{"name"},
    RecordColumn{"revision", K::kInteger},        RecordColumn{"changed_by"},
    RecordColumn{"changed_unix_ns", K::kInteger}, RecordColumn{"removed", K::kInteger}};
constexpr std::array kMemberColumns = {RecordColumn{"group_id", K::kText, true},
                                       RecordColumn{"person", K::kText, true}};
constexpr std::array kConsentColumns = {
    RecordColumn{"id", K::kInteger, true}, RecordColumn{"person"},      RecordColumn{"given", K::kInteger},
    RecordColumn{"unix_ns", K::kInteger},  RecordColumn{"recorded_by"}, RecordColumn{"note"}};
constexpr std::array kStationColumns = {
    RecordColumn{"name", K::kText, true}, RecordColumn{"key_hash", K::kHex, false, true},
    RecordColumn{"revoked", K::kInteger}, RecordColumn{"created_unix_ns", K::kInteger}};
constexpr std::array kProfileColumns = {RecordColumn{"id", K::kText, true},
                                        RecordColumn{"revision", K::kInteger, true},
                                        RecordColumn{"name"},
                                        RecordColumn{"json"},
                                        RecordColumn{"author"},
                                        RecordColumn{"created_unix_ns", K::kInteger}};
constexpr std::array kCourseColumns = {RecordColumn{"id", K::kText, true},
                                       RecordColumn{"revision", K::kInteger, true},
                                       RecordColumn{"name"},
                                       RecordColumn{"json"},
                                       RecordColumn{"author"},
                                       RecordColumn{"created_unix_ns", K::kInteger}};
constexpr std::array kAssignmentColumns = {RecordColumn{"id", K::kInteger, true},
                                           RecordColumn{"course_id"},
                                           RecordColumn{"exercise_id"},
                                           RecordColumn{"group_id"},
                                           RecordColumn{"trainee"},
                                           RecordColumn{"due_unix_ns", K::kInteger},
                                           RecordColumn{"by_whom"},
                                           RecordColumn{"created_unix_ns", K::kInteger}};
constexpr std::array kPolicyColumns = {RecordColumn{"exercise_id", K::kText, true},
                                       RecordColumn{"thin_after_days", K::kInteger},
                                       RecordColumn{"thin_rate_hz", K::kReal},
                                       RecordColumn{"thin_coarser", K::kReal},
                                       RecordColumn{"delete_after_days", K::kInteger},
                                       RecordColumn{"without_backup", K::kInteger},
                                       RecordColumn{"by_whom"},
                                       RecordColumn{"changed_unix_ns", K::kInteger}};
constexpr std::array kSessionColumns = {RecordColumn{"id", K::kHex, true},
                                        RecordColumn{"station"},
                                        RecordColumn{"trainee"},
                                        RecordColumn{"exercise_id"},
                                        RecordColumn{"profile_id"},
                                        RecordColumn{"profile_revision", K::kInteger},
                                        RecordColumn{"profile_json"},
                                        RecordColumn{"engine_version"},
                                        RecordColumn{"rate_hz", K::kReal},
                                        RecordColumn{"started_unix_ns", K::kInteger},
                                        RecordColumn{"description", K::kHex},
                                        RecordColumn{"state", K::kInteger},
                                        RecordColumn{"chunks", K::kCounter},
                                        RecordColumn{"samples", K::kCounter},
                                        RecordColumn{"stored_bytes", K::kCounter},
                                        RecordColumn{"hash", K::kHex},
                                        RecordColumn{"received_unix_ns", K::kInteger},
                                        RecordColumn{"closed_unix_ns", K::kInteger},
                                        RecordColumn{"score_json"},
                                        RecordColumn{"clock_offset_ns", K::kInteger},
                                        RecordColumn{"clock_round_trip_ns", K::kInteger},
                                        RecordColumn{"events", K::kInteger},
                                        RecordColumn{"passed", K::kInteger},
                                        RecordColumn{"excused", K::kInteger},
                                        RecordColumn{"erased", K::kInteger}};
constexpr std::array kUnknownTraineeColumns = {
    RecordColumn{"session", K::kSession, true}, RecordColumn{"given"}, RecordColumn{"by_whom"},
    RecordColumn{"assigned_unix_ns", K::kInteger},
    RecordColumn{"code_unchecked", K::kInteger, false, false, "0"}};
constexpr std::array kSettingColumns = {RecordColumn{"key", K::kText, true}, RecordColumn{"value"}};
constexpr std::array kScoreColumns = {RecordColumn{"session", K::kSession, true},
                                      RecordColumn{"definition_version", K::kInteger, true},
                                      RecordColumn{"measures"},
                                      RecordColumn{"passed", K::kInteger},
                                      RecordColumn{"first", K::kInteger},
                                      RecordColumn{"engine_version"},
                                      RecordColumn{"made_unix_ns", K::kInteger}};
constexpr std::array kEventColumns = {RecordColumn{"session", K::kSession, true},
                                      RecordColumn{"position", K::kInteger, true},
                                      RecordColumn{"kind", K::kInteger},
                                      RecordColumn{"begin_tick", K::kInteger},
                                      RecordColumn{"end_tick", K::kInteger},
                                      RecordColumn{"begin_s", K::kReal},
                                      RecordColumn{"end_s", K::kReal},
                                      RecordColumn{"plunger_from", K::kReal},
                                      RecordColumn{"plunger_to", K::kReal},
                                      RecordColumn{"in_tissue_share", K::kReal},
                                      RecordColumn{"in_target_share", K::kReal},
                                      RecordColumn{"begin_x_m", K::kReal},
                                      RecordColumn{"begin_y_m", K::kReal},
                                      RecordColumn{"begin_z_m", K::kReal},
                                      RecordColumn{"begin_layer", K::kInteger},
                                      RecordColumn{"begin_tissue"},
                                      RecordColumn{"begin_insertion_m", K::kReal},
                                      RecordColumn{"begin_depth_m", K::kReal},
                                      RecordColumn{"begin_target"},
                                      RecordColumn{"begin_target_distance_m", K::kReal},
                                      RecordColumn{"begin_hazard"},
                                      RecordColumn{"end_x_m", K::kReal},
                                      RecordColumn{"end_y_m", K::kReal},
                                      RecordColumn{"end_z_m", K::kReal},
                                      RecordColumn{"end_layer", K::kInteger},
                                      RecordColumn{"end_tissue"},
                                      RecordColumn{"end_insertion_m", K::kReal},
                                      RecordColumn{"end_depth_m", K::kReal},
                                      RecordColumn{"end_target"},
                                      RecordColumn{"end_target_distance_m", K::kReal},
                                      RecordColumn{"end_hazard"},
                                      RecordColumn{"hazards"}};
constexpr std::array kAnnotationColumns = {RecordColumn{"id", K::kInteger, true},
                                           RecordColumn{"session", K::kSession},
                                           RecordColumn{"tick", K::kInteger},
                                           RecordColumn{"text"},
                                           RecordColumn{"author"},
                                           RecordColumn{"created_unix_ns", K::kInteger}};
constexpr std::array kReferenceColumns = {
    RecordColumn{"exercise_id", K::kText, true}, RecordColumn{"revision", K::kInteger, true},
    RecordColumn{"sessions"}, RecordColumn{"by_whom"}, RecordColumn{"created_unix_ns", K::kInteger}};
constexpr std::array kErasureColumns = {
    RecordColumn{"pseudonym", K::kText, true}, RecordColumn{"name_hash", K::kHex},
    RecordColumn{"erased_unix_ns", K::kInteger}, RecordColumn{"by_whom"}, RecordColumn{"reason"},
    // null: an export of an earlier version does not say it
    RecordColumn{"without_account", K::kMark, false, false, "null"}};
constexpr std::array kAuditColumns = {RecordColumn{"id", K::kInteger, true},
                                      RecordColumn{"unix_ns", K::kInteger},
                                      RecordColumn{"who"},
                                      RecordColumn{"action"},
                                      RecordColumn{"subject"},
                                      RecordColumn{"detail"},
                                      RecordColumn{"imported_by", K::kText, false, false, "null"},
                                      RecordColumn{"imported_from", K::kText, false, false, "null"}};

// A person's sessions: not those that count for nobody. A macro, because conditions are put together when
// this is compiled.
#define NEEDLELAB_OWN "trainee = ?1 AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number)"

constexpr std::array kRecordTables = {
    RecordTable{"person", "people", kPersonColumns, "", "name = ?1"},
    RecordTable{"group", "groups", kGroupColumns, "", ""},
    RecordTable{"group_member", "group_members", kMemberColumns, "", "person = ?1"},
    RecordTable{"consent", "consents", kConsentColumns, "", "person = ?1"},
    RecordTable{"station", "stations", kStationColumns, "", ""},
    RecordTable{"profile", "profiles", kProfileColumns, "", ""},
    RecordTable{"course", "curricula", kCourseColumns, "", ""},
    RecordTable{"assignment", "assignments", kAssignmentColumns, "", "trainee = ?1"},
    RecordTable{"retention_policy", "retention_policies", kPolicyColumns, "", ""},
    RecordTable{"lab_setting", "meta", kSettingColumns, "key = 'codes_required'", ""},
    RecordTable{"session", "sessions", kSessionColumns, "state <> 1", NEEDLELAB_OWN},
    RecordTable{"unknown_trainee", "unknown_trainees", kUnknownTraineeColumns,
                "session IN (SELECT number FROM sessions WHERE state <> 1)",
                "session IN (SELECT number FROM sessions WHERE " NEEDLELAB_OWN ")"},
    RecordTable{"score", "scores", kScoreColumns, "session IN (SELECT number FROM sessions WHERE state <> 1)",
                "session IN (SELECT number FROM sessions WHERE " NEEDLELAB_OWN ")"},
    RecordTable{"event", "session_events", kEventColumns,
                "session IN (SELECT number FROM sessions WHERE state <> 1)",
                "session IN (SELECT number FROM sessions WHERE " NEEDLELAB_OWN ")"},
    RecordTable{"annotation", "annotations", kAnnotationColumns,
                "session IN (SELECT number FROM sessions WHERE state <> 1)",
                "author = ?1 OR session IN (SELECT number FROM sessions WHERE " NEEDLELAB_OWN ")"},
    RecordTable{"reference", "exercise_references", kReferenceColumns, "", ""},
    RecordTable{"erasure", "erasures", kErasureColumns, "", ""},
    RecordTable{"audit", "audit", kAuditColumns, "",
                "who = ?1 OR (subject = ?1 AND action IN ('user add', 'user passwd', 'user code', 'code "
                "locked', 'user disable', 'user "
                "change', 'user import', 'consent', 'person export', 'access ended', 'access valid again', "
                "'log-in locked', 'assign', 'assign remove'))"},
};

/// The column's expression in a SELECT.
std::string expressionOf(const RecordColumn& column) {
  const std::string name(column.name);
  if (column.kind == K::kSession) return "(SELECT id FROM sessions WHERE number = session)";
  if (column.kind == K::kCounter)
    return "coalesce((SELECT p." + name + " FROM session_progress p WHERE p.session = number), " + name + ")";
  if (column.kind == K::kMark)
    return "'" + std::string(kWithoutAccountKey) + "' || pseudonym IN (SELECT key FROM meta)";
  return name;
}

bool isWritten(const RecordColumn& column, bool secrets) {
  return secrets || !column.secret;
}

RecordJson valueOf(const RecordColumn& column, const Statement& row, int at) {
  if (row.isNull(at)) return nullptr;
  switch (column.kind) {
    case K::kInteger:
    case K::kCounter:
    case K::kMark:
      return row.integer(at);
    case K::kReal:
      return row.real(at);
    case K::kText:
      return row.text(at);
    case K::kHex:
    case K::kSession:
      return hexDigitsOf(textOf(row.bytes(at)));
  }
  return nullptr;
}

Error recordFault(const RecordColumn& column, const std::string& words) {
  return {ErrorCode::kInvalidInput, std::string(fieldOf(column)) + ": " + words};
}

/// Binds a record's value to a column. kInvalidInput: wrong type; unknown session.
Status bindValue(Connection& connection, Statement& statement, const RecordColumn& column,
                 const RecordJson& value) {
  if (value.is_null()) {
    statement.bindNull();
    return {};
  }
  switch (column.kind) {
    case K::kInteger:
    case K::kCounter:
    case K::kMark:
      if (!value.is_number_integer() ||
          (value.is_number_unsigned() && value.get<std::uint64_t>() > INT64_MAX))
        return recordFault(column, "must be a whole number of 64 bits");
      statement.bind(value.get<std::int64_t>());
      return {};
    case K::kReal:
      if (!value.is_number()) return recordFault(column, "must be a number");
      statement.bind(value.get<double>());
      return {};
    case K::kText:
      if (!value.is_string()) return recordFault(column, "must be a text");
      statement.bind(value.get_ref<const std::string&>());
      return {};
    case K::kHex:
    case K::kSession:
      break;
  }
  if (!value.is_string()) return recordFault(column, "must be a text of hexadecimal digits");
  const auto bytes = bytesOfHex(value.get_ref<const std::string&>());
  if (!bytes) return recordFault(column, bytes.error().message);
  if (column.kind == K::kHex) {
    statement.bind(viewOf(*bytes));
    return {};
  }
  auto session = connection.query("SELECT number FROM sessions WHERE id = ?", viewOf(*bytes));
  ASSIGN_OR_RETURN(const auto found, session.step());
  if (!found) return recordFault(column, "there is no session " + value.get<std::string>());
  statement.bind(session.integer(0));
  return {};
}

/// " WHERE a = ? AND b = ?" over the keys.
std::string whereKeys(const RecordTable& table) {
  std::string where;
  for (const RecordColumn& column : table.columns) {
    if (!column.is_key) continue;
    where += (where.empty() ? "" : " AND ") + std::string(column.name) + " = ?";
  }
  return where;
}

Status bindKeys(Connection& connection, Statement& statement, const RecordTable& table,
                const RecordJson& record) {
  for (const RecordColumn& column : table.columns) {
    if (!column.is_key) continue;
    const auto value = record.find(fieldOf(column));
    if (value == record.end() || value->is_null()) return recordFault(column, "is missing");
    RETURN_IF_ERROR(bindValue(connection, statement, column, *value));
  }
  return {};
}

/// Binds a placeholder for a secret that was not exported: it cannot be used to log in.
Status bindMissing(Statement& statement, const RecordColumn& column) {
  if (!column.secret) return recordFault(column, "is missing");
  if (column.kind == K::kHex) {
    const auto nobody = hashStationKey(makeStationKey());
    statement.bind(ByteView(nobody));
  } else {
    statement.bindNull();
  }
  return {};
}

/// kInvalidInput where a text names a row that is not there. It is looked for before the insert: PostgreSQL
/// would write the name, which may be a person's, into its own log.
Status requireReferred(Connection& writer, const RecordTable& table, const RecordJson& record) {
  struct Reference {
    std::string_view kind, field, to, key, what;
  };
  constexpr std::array kReferences = {Reference{"group_member", "group_id", "groups", "id", "group"},
                                      Reference{"group_member", "person", "people", "name", "person"},
                                      Reference{"consent", "person", "people", "name", "person"},
                                      Reference{"session", "station", "stations", "name", "station"}};
  for (const Reference& reference : kReferences) {
    const auto value = record.find(reference.field);
    if (reference.kind != table.kind || value == record.end() || !value->is_string()) continue;
    const std::string name = value->get<std::string>();
    // as text that no engine takes, bindValue() refuses it
    if (name.find('\0') != std::string::npos) continue;
    auto row = writer.query(
        "SELECT 1 FROM " + std::string(reference.to) + " WHERE " + std::string(reference.key) + " = ?", name);
    ASSIGN_OR_RETURN(const bool there, row.step());
    if (!there)
      return Error{ErrorCode::kInvalidInput,
                   fmt::format("{}: there is no {} '{}', neither here nor before it in these records",
                               reference.field, reference.what, name)};
  }
  return {};
}

}  // namespace

std::string textIn(const RecordJson& record, const char* name) {
  const auto found = record.find(name);
  return found != record.end() && found->is_string() ? found->get<std::string>() : std::string();
}

std::int64_t numberIn(const RecordJson& record, const char* name) {
  const auto found = record.find(name);
  return found != record.end() && found->is_number_integer() ? found->get<std::int64_t>() : 0;
}

bool isGiven(const RecordJson& record, const char* name) {
  const auto found = record.find(name);
  return found != record.end() && !found->is_null();
}

std::string_view fieldOf(const RecordColumn& column) {
  return column.name == "kind" ? std::string_view("what") : column.name;
}

std::span<const RecordTable> recordTables() {
  return kRecordTables;
}

const RecordTable* recordTable(std::string_view kind) {
  const auto found = std::find_if(kRecordTables.begin(), kRecordTables.end(),
                                  [&](const RecordTable& table) { return table.kind == kind; });
  return found == kRecordTables.end() ? nullptr : &*found;
}

std::string selectRecords(const RecordTable& table, std::string_view where, bool secrets) {
  std::string columns, keys;
  for (const RecordColumn& column : table.columns) {
    if (isWritten(column, secrets)) columns += (columns.empty() ? "" : ", ") + expressionOf(column);
    // an expression of the SELECT may have the column's name
    if (column.is_key)
      keys += (keys.empty() ? "" : ", ") + std::string(table.table) + "." + std::string(column.name);
  }
  // revision numbers ascend: a row never refers to a later one
  return "SELECT " + columns + " FROM " + std::string(table.table) +
         (where.empty() ? std::string() : " WHERE " + std::string(where)) + " ORDER BY " + keys;
}

Result<Statement> recordsAfter(Connection& connection, const RecordTable& table, const std::string& where,
                               const std::string* person, const RecordJson& keys, bool secrets,
                               std::int64_t most) {
  std::string condition = where.empty() ? std::string() : "(" + where + ")";
  if (!keys.is_null()) {
    std::string names, places;
    for (const RecordColumn& column : table.columns) {
      if (!column.is_key) continue;
      names += (names.empty() ? "" : ", ") + std::string(column.name);
      places += places.empty() ? "?" : ", ?";
    }
    condition += (condition.empty() ? "(" : " AND (") + names + ") > (" + places + ")";
  }
  auto rows = connection.prepare(selectRecords(table, condition, secrets) + " LIMIT ?");
  if (person != nullptr) rows.bind(*person);
  if (!keys.is_null()) {
    RETURN_IF_ERROR(bindKeys(connection, rows, table, keys));
  }
  rows.bind(most);
  return rows;
}

void fillOlder(const RecordTable& table, RecordJson& record, bool secrets) {
  for (const RecordColumn& column : table.columns) {
    const std::string field(fieldOf(column));
    if (!column.of_older.empty() && isWritten(column, secrets) && !record.contains(field))
      record[field] = RecordJson::parse(column.of_older);
  }
}

RecordJson keysOf(const RecordTable& table, const RecordJson& record) {
  RecordJson keys = RecordJson::object();
  for (const RecordColumn& column : table.columns) {
    if (column.is_key) keys[std::string(fieldOf(column))] = record[std::string(fieldOf(column))];
  }
  return keys;
}

RecordJson recordOf(const RecordTable& table, const Statement& row, bool secrets) {
  RecordJson record{{"kind", table.kind}};
  int at = 0;
  for (const RecordColumn& column : table.columns) {
    if (isWritten(column, secrets)) record[std::string(fieldOf(column))] = valueOf(column, row, at++);
  }
  return record;
}

Result<RecordJson> storedRecord(Connection& connection, const RecordTable& table, const RecordJson& record,
                                bool secrets) {
  auto row = connection.prepare(selectRecords(table, whereKeys(table), secrets));
  RETURN_IF_ERROR(bindKeys(connection, row, table, record));
  ASSIGN_OR_RETURN(const auto found, row.step());
  return found ? recordOf(table, row, secrets) : RecordJson(nullptr);
}

Result<std::int64_t> insertRecord(Connection& writer, const RecordTable& table, const RecordJson& record,
                                  std::string_view number) {
  for (const auto& [name, value] : record.items()) {
    const bool known =
        name == "kind" || std::any_of(table.columns.begin(), table.columns.end(),
                                      [&name = name](const auto& column) { return fieldOf(column) == name; });
    if (!known) return Error{ErrorCode::kInvalidInput, "unknown field '" + name + "'"};
  }
  RETURN_IF_ERROR(checkNumbersLeft(writer, table.table));
  RETURN_IF_ERROR(requireReferred(writer, table, record));
  std::string columns, places;
  for (const RecordColumn& column : table.columns) {
    if (column.kind == K::kMark) continue;
    columns += (columns.empty() ? "" : ", ") + std::string(column.name);
    places += places.empty() ? "?" : ", ?";
  }
  auto insert = writer.prepare("INSERT INTO " + std::string(table.table) + " (" + columns + ") VALUES (" +
                               places + ")" + (number.empty() ? "" : " RETURNING " + std::string(number)));
  for (const RecordColumn& column : table.columns) {
    if (column.kind == K::kMark) continue;
    const auto value = record.find(fieldOf(column));
    auto bound =
        value == record.end() ? bindMissing(insert, column) : bindValue(writer, insert, column, *value);
    if (!bound) return bound.error();
  }
  const auto stored = [&]() -> Result<std::int64_t> {
    if (!number.empty()) return insert.runReturning();
    RETURN_IF_ERROR(insert.run());
    return 0;
  }();
  if (stored || writer.damaged()) return stored;
  return Error{ErrorCode::kInvalidInput, "the schema refuses it: " + stored.error().message};
}

Status removeRecord(Connection& writer, const RecordTable& table, const RecordJson& record) {
  auto remove = writer.prepare("DELETE FROM " + std::string(table.table) + " WHERE " + whereKeys(table));
  RETURN_IF_ERROR(bindKeys(writer, remove, table, record));
  return remove.run();
}

Status dropOldImports(Connection& writer, std::int64_t now_unix_ns) {
  constexpr std::int64_t kLife_ns = 86'400LL * 1'000'000'000;
  constexpr std::int64_t kLifeOfMark_ns = 31 * kLife_ns;
  RETURN_IF_ERROR(writer.run("DELETE FROM import_pieces WHERE position = ? AND unix_ns < ?", kDroppedPieces,
                             now_unix_ns - kLifeOfMark_ns));
  RETURN_IF_ERROR(
      writer.run("INSERT INTO import_pieces (import_id, position, records, by_whom, unix_ns)"
                 " SELECT import_id, ?1, '', '', ?2 FROM import_pieces"
                 " GROUP BY import_id HAVING min(position) > ?1 AND max(unix_ns) < ?3",
                 kDroppedPieces, now_unix_ns, now_unix_ns - kLife_ns));
  return writer.run(
      "DELETE FROM import_pieces WHERE position > ?1 AND import_id IN"
      " (SELECT import_id FROM import_pieces WHERE position = ?1)",
      kDroppedPieces);
}

}  // namespace needlelab
