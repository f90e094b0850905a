#include "db/attempt_store.h"

#include "db/session_row.h"

namespace needlelab {
namespace {

constexpr std::string_view kAttempt =
    "SELECT id, trainee, exercise_id, place, started_unix_ns, passed, state, excused, profile_revision, "
    "engine_version,"
    " score_json FROM (SELECT *, row_number() OVER (PARTITION BY trainee, exercise_id ORDER BY "
    "started_unix_ns, number) AS place"
    " FROM sessions WHERE trainee = ?1 AND (?2 = '' OR exercise_id = ?2) AND trainee <> '') ";

pb::Attempt attemptOf(const Statement& row, bool with_score) {
  pb::Attempt attempt;
  attempt.set_session_id(row.text(0));
  attempt.set_trainee(row.text(1));
  attempt.set_exercise_id(row.text(2));
  attempt.set_number(static_cast<std::uint32_t>(row.natural(3)));
  attempt.set_started_unix_ns(row.integer(4));
  if (!row.isNull(5)) attempt.set_passed(row.integer(5) != 0);
  attempt.set_state(static_cast<pb::SessionState>(row.integer(6)));
  attempt.set_excused(row.integer(7) != 0);
  attempt.set_profile_revision(static_cast<std::uint32_t>(row.natural(8)));
  attempt.set_engine_version(row.text(9));
  if (with_score) attempt.set_score_json(row.text(10));
  return attempt;
}

}  // namespace

Result<std::vector<pb::Attempt>> AttemptStore::list(std::string_view trainee, std::string_view exercise_id,
                                                    bool with_scores) {
  std::vector<pb::Attempt> attempts;
  auto rows =
      connection_.query(std::string(kAttempt) + "ORDER BY started_unix_ns, number", trainee, exercise_id);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return attempts;
    attempts.push_back(attemptOf(rows, with_scores));
  }
}

Result<pb::Attempt> AttemptStore::get(const Uuid& session) {
  std::string trainee, exercise_id;
  {
    auto row = connection_.query("SELECT trainee, exercise_id FROM sessions WHERE id = ?", ByteView(session));
    const auto found = row.step();
    if (!found) return found.error();
    if (!*found) return unknownSession(session);
    trainee = row.text(0);
    exercise_id = row.text(1);
  }
  auto row =
      connection_.query(std::string(kAttempt) + "WHERE id = ?3", trainee, exercise_id, ByteView(session));
  const auto found = row.step();
  if (!found) return found.error();
  if (!*found) return Error{ErrorCode::kNotFound, "session " + uuidText(session) + " is nobody's attempt"};
  return attemptOf(row, true);
}

Result<AttemptStanding> AttemptStore::standing(std::string_view trainee, std::string_view exercise_id) {
  AttemptStanding standing;
  auto row = connection_.query(
      "SELECT count(*), coalesce(sum(excused = 0), 0), max(CASE excused WHEN 0 THEN passed END) FROM "
      "sessions WHERE trainee = ? AND "
      "exercise_id = ?",
      trainee, exercise_id);
  const auto found = row.step();
  if (!found) return found.error();
  standing.all = static_cast<std::uint32_t>(row.natural(0));
  standing.counted = static_cast<std::uint32_t>(row.natural(1));
  if (!row.isNull(2)) standing.passed = row.integer(2) != 0;
  return standing;
}

Result<std::vector<std::string>> AttemptStore::trainees(std::string_view course_id) {
  std::vector<std::string> names;
  auto rows = connection_.query(
      "SELECT DISTINCT trainee FROM sessions WHERE trainee <> '' AND erased = 0 AND exercise_id IN"
      " (SELECT id FROM exercises WHERE curriculum_id = ?) ORDER BY trainee",
      course_id);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return names;
    names.push_back(rows.text(0));
  }
}

Result<bool> AttemptStore::excuse(const Uuid& session, bool excused) {
  if (const auto known = findSession(connection_, session); !known || !*known)
    return known ? unknownSession(session) : known.error();
  if (auto done = connection_.run("UPDATE sessions SET excused = ? WHERE id = ? AND excused <> ?", excused,
                                  ByteView(session), excused);
      !done)
    return done.error();
  return connection_.changes() != 0;
}

}  // namespace needlelab
