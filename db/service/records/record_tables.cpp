#include "db/service/records/record_tables.h"

#include <fmt/core.h>

#include <array>

#include "common/base/text/text.h"
#include "db/people/person_refs.h"

namespace needlelab {
namespace {

using K = RecordColumnKind;

constexpr std::array kPersonColumns = {RecordColumn{"ref", K::kText, true},
                                       RecordColumn{"uuid", K::kHex},
                                       RecordColumn{"name"},
                                       RecordColumn{"role", K::kInteger},
                                       RecordColumn{"password_hash", K::kText, false, true},
                                       RecordColumn{"disabled", K::kInteger},
                                       RecordColumn{"created_unix_ns", K::kInteger},
                                       RecordColumn{"full_name"},
                                       RecordColumn{"revision", K::kInteger},
                                       RecordColumn{"changed_unix_ns", K::kInteger},
                                       RecordColumn{"changed_by", K::kPerson},
                                       RecordColumn{"code_hash", K::kText, false, true}};
constexpr std::array kGroupColumns = {
    RecordColumn{"id", K::kText, true},           RecordColumn{"name"},
    RecordColumn{"revision", K::kInteger},        RecordColumn{"changed_by", K::kPerson},
    RecordColumn{"changed_unix_ns", K::kInteger}, RecordColumn{"removed", K::kInteger}};
constexpr std::array kMemberColumns = {RecordColumn{"group_id", K::kText, true},
                                       RecordColumn{"person", K::kPerson, true}};
constexpr std::array kConsentColumns = {
    RecordColumn{"id", K::kInteger, true},   RecordColumn{"person", K::kPerson},
    RecordColumn{"given", K::kInteger},      RecordColumn{"unix_ns", K::kInteger},
    RecordColumn{"recorded_by", K::kPerson}, RecordColumn{"note"}};
constexpr std::array kStationColumns = {
    RecordColumn{"name", K::kText, true}, RecordColumn{"key_hash", K::kHex, false, true},
    RecordColumn{"revoked", K::kInteger}, RecordColumn{"created_unix_ns", K::kInteger}};
constexpr std::array kProfileColumns = {RecordColumn{"id", K::kText, true},
                                        RecordColumn{"revision", K::kInteger, true},
                                        RecordColumn{"name"},
                                        RecordColumn{"json"},
                                        RecordColumn{"author", K::kPerson},
                                        RecordColumn{"created_unix_ns", K::kInteger}};
constexpr std::array kCourseColumns = {RecordColumn{"id", K::kText, true},
                                       RecordColumn{"revision", K::kInteger, true},
                                       RecordColumn{"name"},
                                       RecordColumn{"json"},
                                       RecordColumn{"author", K::kPerson},
                                       RecordColumn{"created_unix_ns", K::kInteger}};
constexpr std::array kAssignmentColumns = {
    RecordColumn{"id", K::kInteger, true}, RecordColumn{"course_id"},
    RecordColumn{"exercise_id"},           RecordColumn{"group_id"},
    RecordColumn{"trainee", K::kPerson},   RecordColumn{"due_unix_ns", K::kInteger},
    RecordColumn{"by_whom", K::kPerson},   RecordColumn{"created_unix_ns", K::kInteger}};
constexpr std::array kPolicyColumns = {RecordColumn{"exercise_id", K::kText, true},
                                       RecordColumn{"thin_after_days", K::kInteger},
                                       RecordColumn{"thin_rate_hz", K::kReal},
                                       RecordColumn{"thin_coarser", K::kReal},
                                       RecordColumn{"delete_after_days", K::kInteger},
                                       RecordColumn{"without_backup", K::kInteger},
                                       RecordColumn{"by_whom", K::kPerson},
                                       RecordColumn{"changed_unix_ns", K::kInteger}};
constexpr std::array kSessionColumns = {RecordColumn{"id", K::kHex, true},
                                        RecordColumn{"station"},
                                        RecordColumn{"trainee", K::kPerson},
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
    RecordColumn{"session", K::kSession, true},  RecordColumn{"given", K::kPerson},
    RecordColumn{"by_whom", K::kPerson},         RecordColumn{"assigned_unix_ns", K::kInteger},
    RecordColumn{"code_unchecked", K::kInteger}, RecordColumn{"begin_unsure", K::kInteger},
    RecordColumn{"not_assigned", K::kInteger}};
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
constexpr std::array kAnnotationColumns = {
    RecordColumn{"id", K::kInteger, true}, RecordColumn{"session", K::kSession},
    RecordColumn{"tick", K::kInteger},     RecordColumn{"text"},
    RecordColumn{"author", K::kPerson},    RecordColumn{"created_unix_ns", K::kInteger}};
constexpr std::array kReferenceColumns = {RecordColumn{"exercise_id", K::kText, true},
                                          RecordColumn{"revision", K::kInteger, true},
                                          RecordColumn{"sessions"}, RecordColumn{"by_whom", K::kPerson},
                                          RecordColumn{"created_unix_ns", K::kInteger}};
constexpr std::array kErasureColumns = {RecordColumn{"uuid", K::kHex, true},
                                        RecordColumn{"erased_unix_ns", K::kInteger},
                                        RecordColumn{"by_whom", K::kPerson}, RecordColumn{"reason"}};
constexpr std::array kAuditColumns = {
    RecordColumn{"id", K::kInteger, true}, RecordColumn{"unix_ns", K::kInteger},
    RecordColumn{"who", K::kPerson},       RecordColumn{"action"},
    RecordColumn{"subject", K::kPerson},   RecordColumn{"detail"}};

// A person's sessions, without those that count for no one. A macro, because conditions are concatenated at
// compile time.
#define NEEDLELAB_OWN "trainee = ?1 AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number)"

constexpr std::array kRecordTables = {
    RecordTable{"person", "accounts", kPersonColumns, "", "ref = ?1"},
    RecordTable{"group", "groups", kGroupColumns, "", ""},
    RecordTable{"group_member", "group_members", kMemberColumns, "", "person = ?1"},
    RecordTable{"consent", "consents", kConsentColumns, "", "person = ?1"},
    RecordTable{"station", "stations", kStationColumns, "", ""},
    RecordTable{"profile", "profiles", kProfileColumns, "", ""},
    RecordTable{"course", "curricula", kCourseColumns, "", ""},
    RecordTable{"assignment", "assignments", kAssignmentColumns, "", "trainee = ?1"},
    RecordTable{"retention_policy", "retention_policies", kPolicyColumns, "", ""},
    RecordTable{"lab_setting", "meta", kSettingColumns,
                "key IN ('codes_required', 'keep_recordings_of_erased')", ""},
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
  if (column.kind == K::kPerson)
    return "coalesce((SELECT c.name FROM called c WHERE c.ref = " + name + "), " + name + ")";
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
      return row.integer(at);
    case K::kReal:
      return row.real(at);
    case K::kText:
    case K::kPerson:
      return row.text(at);
    case K::kHex:
    case K::kSession:
      return hexDigitsOf(textOf(row.bytes(at)));
  }
  return nullptr;
}

/// Binds a key of a page's last record. kInvalidInput: its session is gone.
Status bindKey(Connection& connection, Statement& statement, const RecordColumn& column,
               const RecordJson& value) {
  if (value.is_number()) {
    statement.bind(value.get<std::int64_t>());
    return {};
  }
  const auto& text = value.get_ref<const std::string&>();
  if (column.kind == K::kText) {
    statement.bind(text);
    return {};
  }
  if (column.kind == K::kPerson) {
    ASSIGN_OR_RETURN(const auto ref, findPerson(connection, text));
    statement.bind(ref.value_or(text));
    return {};
  }
  ASSIGN_OR_RETURN(const auto bytes, bytesOfHex(text));
  if (column.kind == K::kHex) {
    statement.bind(viewOf(bytes));
    return {};
  }
  auto session = connection.query("SELECT number FROM sessions WHERE id = ?", viewOf(bytes));
  ASSIGN_OR_RETURN(const bool found, session.step());
  if (!found) return Error{ErrorCode::kInvalidInput, "session: there is no session " + text};
  statement.bind(session.integer(0));
  return {};
}

/// A column's name in a record. The record's "kind" names the table.
std::string fieldOf(const RecordColumn& column) {
  return column.name == "kind" ? "what" : column.name == "ref" ? "id" : std::string(column.name);
}

}  // namespace

std::span<const RecordTable> recordTables() {
  return kRecordTables;
}

Result<Statement> recordsAfter(Connection& connection, const RecordTable& table, const std::string& where,
                               const std::string* person, const RecordJson& keys, bool secrets,
                               std::int64_t most) {
  std::string columns, names, order, places;
  for (const RecordColumn& column : table.columns) {
    if (isWritten(column, secrets)) columns += (columns.empty() ? "" : ", ") + expressionOf(column);
    if (!column.is_key) continue;
    const std::string name(column.name), separator(names.empty() ? "" : ", ");
    names += separator + name;
    // an expression in the SELECT may have the column's name
    order += separator + std::string(table.table) + "." + name;
    places += separator + "?";
  }
  std::string condition = where.empty() ? std::string() : "(" + where + ")";
  if (!keys.is_null())
    condition += fmt::format("{}({}) > ({})", condition.empty() ? "" : " AND ", names, places);
  // revision numbers ascend: a row never refers to a later one
  auto rows = connection.prepare(fmt::format("SELECT {} FROM {}{} ORDER BY {} LIMIT ?", columns, table.table,
                                             condition.empty() ? "" : " WHERE " + condition, order));
  if (person != nullptr) rows.bind(*person);
  if (!keys.is_null()) {
    for (const RecordColumn& column : table.columns)
      if (column.is_key) RETURN_IF_ERROR(bindKey(connection, rows, column, keys.at(fieldOf(column))));
  }
  rows.bind(most);
  return rows;
}

RecordJson keysOf(const RecordTable& table, const RecordJson& record) {
  RecordJson keys = RecordJson::object();
  for (const RecordColumn& column : table.columns) {
    if (column.is_key) keys[fieldOf(column)] = record[fieldOf(column)];
  }
  return keys;
}

RecordJson recordOf(const RecordTable& table, const Statement& row, bool secrets) {
  RecordJson record{{"kind", table.kind}};
  int at = 0;
  for (const RecordColumn& column : table.columns) {
    if (isWritten(column, secrets)) record[fieldOf(column)] = valueOf(column, row, at++);
  }
  return record;
}

}  // namespace needlelab
