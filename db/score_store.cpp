#include "db/score_store.h"

#include <algorithm>
#include <set>

#include "db/curriculum_store.h"
#include "db/revision.h"
#include "db/session_row.h"

namespace needlelab {
namespace {

constexpr std::string_view kScore =
    "SELECT s.id, c.definition_version, c.measures, c.passed, c.made_unix_ns, c.first, c.engine_version"
    " FROM scores c JOIN sessions s ON s.number = c.session WHERE s.id = ?1 ";
constexpr std::size_t kMaxReferences = 200;

pb::Score scoreOfRow(const Statement& row) {
  pb::Score score;
  score.set_session_id(row.text(0));
  score.set_definition_version(static_cast<std::uint32_t>(row.natural(1)));
  score.set_measures_json(row.text(2));
  if (!row.isNull(3)) score.set_passed(row.integer(3) != 0);
  score.set_made_unix_ns(row.integer(4));
  score.set_first(row.integer(5) != 0);
  score.set_engine_version(row.text(6));
  return score;
}

/// Ids as text, one a JSON list: ["…","…"].
std::string idsJson(const std::vector<Uuid>& ids) {
  std::string json;
  for (const Uuid& id : ids) json += (json.empty() ? "\"" : ",\"") + uuidText(id) + "\"";
  return "[" + json + "]";
}

}  // namespace

Status ScoreStore::put(const pb::Score& score) {
  const auto id = uuidOf(score.session_id());
  if (!id || score.definition_version() == 0)
    return Error{ErrorCode::kInvalidInput,
                 "score: wants a session_id of 16 bytes and a definition_version from 1"};
  std::int64_t number = 0;
  bool has_first = false;
  {
    auto row = connection_.query(
        "SELECT number, erased, EXISTS (SELECT 1 FROM scores WHERE session = number AND first = 1) FROM "
        "sessions WHERE id = ?",
        ByteView(*id));
    const auto found = row.step();
    if (!found) return found.error();
    if (!*found) return unknownSession(*id);
    if (row.integer(1) != 0)
      return Error{ErrorCode::kUnavailable,
                   "session " + uuidText(*id) + ": its person's data was erased, it gets no score"};
    number = row.integer(0);
    has_first = row.integer(2) != 0;
  }
  const int passed = score.has_passed() ? (score.passed() ? 1 : 0) : -1;
  if (auto done = connection_.run(
          "INSERT INTO scores (session, definition_version, measures, passed, first, "
          "engine_version, made_unix_ns) VALUES"
          " (?,?,?,nullif(?, -1),?,?,?) ON CONFLICT (session, definition_version) DO UPDATE SET "
          "measures = excluded.measures,"
          " passed = excluded.passed, engine_version = excluded.engine_version, "
          "made_unix_ns = excluded.made_unix_ns"
          " WHERE first = 0",
          number, score.definition_version(), score.measures_json(), passed, !has_first,
          score.engine_version(), score.made_unix_ns());
      !done)
    return done;
  return connection_.run(
      "UPDATE sessions SET (score_json, passed) = (SELECT measures, passed FROM scores WHERE session = number"
      " AND first = 1) WHERE number = ?",
      number);
}

Result<pb::Score> ScoreStore::get(const Uuid& session, std::uint32_t version) {
  auto row = connection_.query(
      std::string(kScore) +
          "AND (?2 = 0 OR c.definition_version = ?2) ORDER BY c.definition_version DESC LIMIT 1",
      ByteView(session), version);
  const auto found = row.step();
  if (!found) return found.error();
  if (*found) return scoreOfRow(row);
  return Error{ErrorCode::kNotFound,
               "session " + uuidText(session) + " has no score" +
                   (version == 0 ? std::string() : " of definition version " + std::to_string(version))};
}

Result<std::vector<pb::Score>> ScoreStore::list(const Uuid& session) {
  std::vector<pb::Score> scores;
  auto rows = connection_.query(std::string(kScore) + "ORDER BY c.definition_version", ByteView(session));
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return scores;
    scores.push_back(scoreOfRow(rows));
  }
}

Result<pb::Reference> ReferenceStore::put(const std::string& exercise_id, const std::vector<Uuid>& sessions,
                                          std::uint32_t base, const std::string& by,
                                          std::int64_t now_unix_ns) {
  if (const auto exercise = CurriculumStore(connection_).exercise(exercise_id); !exercise)
    return exercise.error();
  const auto before = get(exercise_id);
  if (!before) return before.error();
  const std::string name = "the reference of exercise '" + exercise_id + "'";
  if (auto same =
          checkBase(name, base, {before->revision(), before->changed_by(), before->changed_unix_ns()});
      !same)
    return same.error();
  if (sessions.size() > kMaxReferences)
    return Error{ErrorCode::kInvalidInput, name + ", session_ids: has " + std::to_string(sessions.size()) +
                                               ", allowed are at most " + std::to_string(kMaxReferences)};
  std::set<Uuid> seen;
  for (const Uuid& session : sessions) {
    const std::string which = name + ", session " + uuidText(session);
    if (!seen.insert(session).second) return Error{ErrorCode::kInvalidInput, which + ": is named twice"};
    auto row = connection_.query("SELECT exercise_id, state FROM sessions WHERE id = ?", ByteView(session));
    const auto found = row.step();
    if (!found) return found.error();
    if (!*found) return unknownSession(session);
    if (row.text(0) != exercise_id)
      return Error{ErrorCode::kInvalidInput, which + ": is of exercise '" + row.text(0) + "'"};
    if (row.integer(1) == pb::SESSION_OPEN) return Error{ErrorCode::kInvalidInput, which + ": is still open"};
  }
  if (auto done = connection_.run(
          "INSERT INTO exercise_references (exercise_id, revision, sessions, by_whom, created_unix_ns)"
          " VALUES (?,?,?,?,?)",
          exercise_id, before->revision() + 1, idsJson(sessions), by, now_unix_ns);
      !done)
    return done.error();
  return get(exercise_id);
}

Result<pb::Reference> ReferenceStore::get(std::string_view exercise_id) {
  pb::Reference reference;
  reference.set_exercise_id(std::string(exercise_id));
  auto row = connection_.query(
      "SELECT revision, by_whom, created_unix_ns FROM exercise_references WHERE exercise_id = ? ORDER BY "
      "revision DESC LIMIT 1",
      exercise_id);
  const auto found = row.step();
  if (!found) return found.error();
  if (!*found) return reference;
  reference.set_revision(static_cast<std::uint32_t>(row.natural(0)));
  reference.set_changed_by(row.text(1));
  reference.set_changed_unix_ns(row.integer(2));
  // those that are still there: an erased person's are not
  auto ids = connection_.query(
      "SELECT s.id FROM exercise_references r, json_each(r.sessions) j JOIN sessions s"
      " ON lower(hex(s.id)) = replace(j.value, '-', '') WHERE r.exercise_id = ? AND r.revision = ? AND "
      "s.erased = 0 ORDER BY j.key",
      exercise_id, reference.revision());
  for (;;) {
    const auto next = ids.step();
    if (!next) return next.error();
    if (!*next) return reference;
    reference.add_session_ids(ids.text(0));
  }
}

}  // namespace needlelab
