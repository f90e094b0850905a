#include "db/assignments.h"

#include <fmt/core.h>

#include <cstdint>
#include <iterator>
#include <optional>
#include <utility>

#include "db/documents.h"
#include "db/people.h"
#include "db/session_rows.h"

namespace needlelab {
namespace {

constexpr std::string_view kAssignment =
    "SELECT id, course_id, exercise_id, group_id, trainee, due_unix_ns, by_whom,"
    " created_unix_ns FROM assignments ";

pb::Assignment assignmentOf(const Statement& row) {
  pb::Assignment found;
  found.set_id(row.natural(0));
  found.set_course_id(row.text(1));
  found.set_exercise_id(row.text(2));
  found.set_group_id(row.text(3));
  found.set_trainee(row.text(4));
  found.set_due_unix_ns(row.integer(5));
  found.set_by(row.text(6));
  found.set_created_unix_ns(row.integer(7));
  return found;
}

Status checkTrainee(Connection& connection, const std::string& name) {
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection).find(name));
  if (!person) return Error{ErrorCode::kNotFound, "there is no person named '" + name + "'"};
  if (person->role != pb::TRAINEE)
    return Error{ErrorCode::kInvalidInput, "'" + name + "' is no trainee: exercises are for trainees"};
  return {};
}

/// Without sessions that count for nobody (migrations/0007_trainee_codes.sql); ?3 may name one that is wanted
/// all the same. The places come of the keys alone: descriptions and scores are read of the rows that are
/// wanted.
constexpr std::string_view kPlaces =
    "SELECT number, started_unix_ns, row_number() OVER (PARTITION BY trainee, exercise_id"
    " ORDER BY started_unix_ns, number) AS place FROM sessions WHERE trainee = ?1"
    " AND (?2 = '' OR exercise_id = ?2) AND trainee <> ''"
    " AND (id = ?3 OR NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number))";

/// The attempts of these places; `rest` goes behind. A score that is not wanted is not read.
std::string attemptsAt(std::string_view places, std::string_view rest, bool with_score) {
  return fmt::format(
      "SELECT s.id, s.trainee, s.exercise_id, p.place, s.started_unix_ns, s.passed, s.state,"
      " s.excused, s.profile_revision, s.engine_version, {}"
      " FROM ({}) p JOIN sessions s ON s.number = p.number {}",
      with_score ? "s.score_json" : "NULL", places, rest);
}
constexpr std::string_view kInOrder = "ORDER BY s.started_unix_ns, s.number";

/// The best attempt of trainee ?1 at each exercise of course ?2: the last entry of sessions_by_verdict, whose
/// terms these are (migrations/0009_attempt_sums.sql).
constexpr std::string_view kBest =
    "SELECT s.id, s.trainee, s.exercise_id, (SELECT count(*) FROM sessions e WHERE e.trainee = s.trainee"
    " AND e.exercise_id = s.exercise_id AND (e.started_unix_ns, e.number) <= (s.started_unix_ns, s.number)"
    " AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = e.number)),"
    " s.started_unix_ns, s.passed, s.state, s.excused, s.profile_revision, s.engine_version"
    " FROM attempt_sums a JOIN sessions s ON s.number = (SELECT b.number FROM sessions b"
    " WHERE b.trainee = a.trainee AND b.exercise_id = a.exercise_id AND b.excused = 0 AND b.state <> 1"
    " AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = b.number)"
    " ORDER BY coalesce(b.passed, 0) DESC, (length(replace(coalesce(b.score_json, ''), ' ', '')) -"
    " length(replace(replace(coalesce(b.score_json, ''), ' ', ''), '\"passed\":true', ''))) / 13 DESC,"
    " b.started_unix_ns DESC, b.number DESC LIMIT 1)"
    " WHERE a.trainee = ?1 AND a.counted > 0"
    " AND a.exercise_id IN (SELECT id FROM exercises WHERE curriculum_id = ?2)";

constexpr std::string_view kStanding =
    "SELECT exercise_id, attempts, counted, judged, passed FROM attempt_sums ";

std::pair<std::string, AttemptStanding> standingOfRow(const Statement& row) {
  AttemptStanding standing;
  standing.all = row.natural32(1);
  standing.counted = row.natural32(2);
  if (row.integer(3) > 0) standing.passed = row.integer(4) > 0;
  return {row.text(0), standing};
}

pb::Attempt attemptOf(const Statement& row, bool with_score) {
  pb::Attempt attempt;
  attempt.set_session_id(row.text(0));
  attempt.set_trainee(row.text(1));
  attempt.set_exercise_id(row.text(2));
  attempt.set_number(row.natural32(3));
  attempt.set_started_unix_ns(row.integer(4));
  if (!row.isNull(5)) attempt.set_passed(row.integer(5) != 0);
  attempt.set_state(static_cast<pb::SessionState>(row.integer(6)));
  attempt.set_excused(row.integer(7) != 0);
  attempt.set_profile_revision(row.natural32(8));
  attempt.set_engine_version(row.text(9));
  if (with_score) attempt.set_score_json(row.text(10));
  return attempt;
}

}  // namespace

Result<pb::Assignment> AssignmentStore::put(const pb::Assignment& given) {
  if (given.course_id().empty() == given.exercise_id().empty())
    return Error{ErrorCode::kInvalidInput, "assignment: give exactly one of course_id and exercise_id"};
  if (given.group_id().empty() == given.trainee().empty())
    return Error{ErrorCode::kInvalidInput, "assignment: give exactly one of group_id and trainee"};
  if (given.due_unix_ns() < 0)
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("assignment, due_unix_ns: {}, allowed is 0 (never) and above", given.due_unix_ns())};
  if (!given.trainee().empty()) {
    RETURN_IF_ERROR(checkTrainee(connection_, given.trainee()));
  } else if (const auto group = GroupStore(connection_).get(given.group_id()); !group) {
    return group.error();
  }
  if (!given.course_id().empty()) {
    RETURN_IF_ERROR(CurriculumStore(connection_).get(given.course_id()));
  } else if (const auto exercise = CurriculumStore(connection_).exercise(given.exercise_id()); !exercise) {
    return exercise.error();
  }
  auto known = connection_.query(
      "SELECT id FROM assignments WHERE coalesce(course_id, '') = ?"
      " AND coalesce(exercise_id, '') = ? AND coalesce(group_id, '') = ?"
      " AND coalesce(trainee, '') = ?",
      given.course_id(), given.exercise_id(), given.group_id(), given.trainee());
  ASSIGN_OR_RETURN(const bool found, known.step());
  pb::Assignment stored = given;
  if (found) {
    stored.set_id(known.natural(0));
    auto renew = connection_.query(
        "UPDATE assignments SET by_whom = ?, created_unix_ns = ?, due_unix_ns = nullif(?, 0) WHERE id = ?",
        given.by(), given.created_unix_ns(), given.due_unix_ns(), stored.id());
    RETURN_IF_ERROR(renew.run());
    return stored;
  }
  RETURN_IF_ERROR(checkNumbersLeft(connection_, "assignments"));
  ASSIGN_OR_RETURN(
      const auto id,
      connection_.insert("INSERT INTO assignments (course_id, exercise_id, group_id, trainee,"
                         " due_unix_ns, by_whom, created_unix_ns)"
                         " VALUES (nullif(?, ''), nullif(?, ''), nullif(?, ''), nullif(?, ''),"
                         " nullif(?, 0), ?, ?) RETURNING id",
                         given.course_id(), given.exercise_id(), given.group_id(), given.trainee(),
                         given.due_unix_ns(), given.by(), given.created_unix_ns()));
  stored.set_id(static_cast<std::uint64_t>(id));
  return stored;
}

Result<pb::Assignment> AssignmentStore::remove(std::uint64_t id) {
  ASSIGN_OR_RETURN(const auto removed,
                   connection_.query(std::string(kAssignment) + "WHERE id = ?", id).first(assignmentOf));
  if (!removed) return Error{ErrorCode::kNotFound, fmt::format("there is no assignment {}", id)};
  RETURN_IF_ERROR(connection_.run("DELETE FROM assignments WHERE id = ?", id));
  return *removed;
}

Result<std::vector<pb::Assignment>> AssignmentStore::list(const Filter& filter) {
  return connection_
      .query(std::string(kAssignment) +
                 "WHERE (?1 = '' OR trainee = ?1 OR group_id IN (SELECT group_id"
                 " FROM group_members WHERE person = ?1)) AND (?2 = ''"
                 " OR course_id = ?2 OR exercise_id IN (SELECT id FROM exercises"
                 " WHERE curriculum_id = ?2)) AND (?3 = '' OR group_id = ?3)"
                 " ORDER BY id DESC",
             filter.trainee, filter.course_id, filter.group_id)
      .all(assignmentOf);
}

Result<std::vector<DueRule>> AssignmentStore::dueRules(std::string_view trainee) {
  return connection_
      .query(
          "SELECT course_id, exercise_id, CASE WHEN trainee IS NULL THEN 1 ELSE 0 END, due_unix_ns"
          " FROM assignments WHERE due_unix_ns IS NOT NULL AND (trainee = ?1"
          " OR group_id IN (SELECT group_id FROM group_members WHERE person = ?1))",
          trainee)
      .all([](const Statement& row) {
        return DueRule{row.text(0), row.text(1), row.integer(2) != 0, row.integer(3)};
      });
}

Result<std::int64_t> AssignmentStore::dueOf(std::string_view trainee, std::string_view exercise_id,
                                            std::string_view course_id, std::int64_t otherwise) {
  ASSIGN_OR_RETURN(const auto rules, dueRules(trainee));
  return dueBy(rules, exercise_id, course_id, otherwise);
}

std::int64_t dueBy(std::span<const DueRule> rules, std::string_view exercise_id, std::string_view course_id,
                   std::int64_t otherwise) {
  const DueRule* best = nullptr;
  // the order of precedence as a number: the least counts, of equal ones the latest date
  const auto rank = [](const DueRule& rule) {
    return (rule.of_group ? 2 : 0) + (rule.exercise_id.empty() ? 1 : 0);
  };
  for (const DueRule& rule : rules) {
    if (rule.exercise_id.empty() ? rule.course_id != course_id : rule.exercise_id != exercise_id) continue;
    if (best == nullptr || rank(rule) < rank(*best) ||
        (rank(rule) == rank(*best) && rule.due_unix_ns > best->due_unix_ns))
      best = &rule;
  }
  return best == nullptr ? otherwise : best->due_unix_ns;
}

Result<std::vector<pb::Attempt>> AttemptStore::list(std::string_view trainee, std::string_view exercise_id,
                                                    bool with_scores) {
  return connection_.query(attemptsAt(kPlaces, kInOrder, with_scores), trainee, exercise_id)
      .all([&](const Statement& row) { return attemptOf(row, with_scores); });
}

Result<std::vector<pb::Attempt>> AttemptStore::page(std::string_view trainee, std::string_view exercise_id,
                                                    const std::optional<Uuid>& after, std::size_t most) {
  std::int64_t started_ns = INT64_MIN, number = 0;
  if (after) {
    auto row = connection_.query(
        "SELECT started_unix_ns, number FROM sessions WHERE id = ?3 AND trainee = ?1"
        " AND (?2 = '' OR exercise_id = ?2) AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = "
        "number)",
        trainee, exercise_id, ByteView(*after));
    ASSIGN_OR_RETURN(const bool found, row.step());
    if (!found) return unknownSession(*after);
    started_ns = row.integer(0);
    number = row.integer(1);
  }
  const std::string places = fmt::format(
      "SELECT * FROM ({}) AS places WHERE (started_unix_ns, number) > (?4, ?5)"
      " ORDER BY started_unix_ns, number LIMIT ?6",
      kPlaces);
  // the third value: nothing is wanted all the same
  return connection_
      .query(attemptsAt(places, kInOrder, true), trainee, exercise_id, ByteView(), started_ns, number,
             static_cast<std::uint64_t>(most))
      .all([](const Statement& row) { return attemptOf(row, true); });
}

Result<pb::Attempt> AttemptStore::get(const Uuid& session) {
  std::string trainee, exercise_id;
  {
    auto row = connection_.query("SELECT trainee, exercise_id FROM sessions WHERE id = ?", ByteView(session));
    ASSIGN_OR_RETURN(const bool found, row.step());
    if (!found) return unknownSession(session);
    trainee = row.text(0);
    exercise_id = row.text(1);
  }
  auto row = connection_.query(attemptsAt(kPlaces, "WHERE s.id = ?3", true), trainee, exercise_id,
                               ByteView(session));
  ASSIGN_OR_RETURN(const bool found, row.step());
  if (!found) return Error{ErrorCode::kNotFound, "session " + uuidText(session) + " is nobody's attempt"};
  return attemptOf(row, true);
}

Result<AttemptStanding> AttemptStore::standing(std::string_view trainee, std::string_view exercise_id) {
  ASSIGN_OR_RETURN(
      const auto found,
      connection_
          .query(std::string(kStanding) + "WHERE trainee = ? AND exercise_id = ?", trainee, exercise_id)
          .first(standingOfRow));
  return found ? found->second : AttemptStanding{};
}

Result<std::map<std::string, AttemptStanding>> AttemptStore::standings(std::string_view trainee) {
  ASSIGN_OR_RETURN(
      auto rows, connection_.query(std::string(kStanding) + "WHERE trainee = ?", trainee).all(standingOfRow));
  return std::map<std::string, AttemptStanding>(std::make_move_iterator(rows.begin()),
                                                std::make_move_iterator(rows.end()));
}

Result<std::map<std::string, pb::Attempt>> AttemptStore::best(std::string_view trainee,
                                                              std::string_view course_id) {
  ASSIGN_OR_RETURN(auto attempts, connection_.query(kBest, trainee, course_id).all([](const Statement& row) {
    return attemptOf(row, false);
  }));
  std::map<std::string, pb::Attempt> best;
  for (pb::Attempt& attempt : attempts) {
    std::string exercise = attempt.exercise_id();
    best.emplace(std::move(exercise), std::move(attempt));
  }
  return best;
}

Result<bool> AttemptStore::excuse(const Uuid& session, bool excused) {
  if (const auto known = findSession(connection_, session); !known || !*known)
    return known ? unknownSession(session) : known.error();
  RETURN_IF_ERROR(connection_.run("UPDATE sessions SET excused = ? WHERE id = ? AND excused <> ?", excused,
                                  ByteView(session), excused));
  return connection_.changes() != 0;
}

}  // namespace needlelab
