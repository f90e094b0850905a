#include "db/teaching/attempts.h"

#include <fmt/core.h>

#include <iterator>
#include <utility>

#include "db/store/rows.h"

namespace needlelab {
namespace {

/// Without sessions that count for no one (migrations/0001_first.sql), except the one that ?3 may name.
/// Places are computed from keys alone; descriptions and scores are read only for the wanted rows.
constexpr std::string_view kPlaces =
    "SELECT number, started_unix_ns, row_number() OVER (PARTITION BY trainee, exercise_id"
    " ORDER BY started_unix_ns, number) AS place FROM sessions WHERE trainee = ?1"
    " AND (?2 = '' OR exercise_id = ?2) AND trainee <> ''"
    " AND (id = ?3 OR NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number))";

/// The attempts at these places; `rest` is appended. An unwanted score is not read.
std::string attemptsAt(std::string_view places, std::string_view rest, bool with_score) {
  return fmt::format("SELECT {}, {} FROM ({}) p JOIN sessions s ON s.number = p.number {}", kAttemptColumns,
                     with_score ? "s.score_json" : "NULL", places, rest);
}
constexpr std::string_view kInOrder = "ORDER BY s.started_unix_ns, s.number";

/// The best attempt in each exercise of course ?1 by the trainees ?2, whose list is appended: the last entry
/// of sessions_by_verdict, whose conditions these are (migrations/0001_first.sql). The score column, if
/// wanted, goes between the two parts.
constexpr std::string_view kBestColumns =
    "SELECT s.id, s.trainee, s.exercise_id, (SELECT count(*) FROM sessions e WHERE e.trainee = s.trainee"
    " AND e.exercise_id = s.exercise_id AND (e.started_unix_ns, e.number) <= (s.started_unix_ns, s.number)"
    " AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = e.number)),"
    " s.started_unix_ns, s.passed, s.state, s.excused, s.profile_revision, s.engine_version";
constexpr std::string_view kBest =
    " FROM attempt_sums a JOIN sessions s ON s.number = (SELECT b.number FROM sessions b"
    " WHERE b.trainee = a.trainee AND b.exercise_id = a.exercise_id AND b.excused = 0 AND b.state <> 1"
    " AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = b.number)"
    " ORDER BY coalesce(b.passed, 0) DESC, (length(replace(coalesce(b.score_json, ''), ' ', '')) -"
    " length(replace(replace(coalesce(b.score_json, ''), ' ', ''), '\"passed\":true', ''))) / 13 DESC,"
    " b.started_unix_ns DESC, b.number DESC LIMIT 1)"
    " WHERE a.counted > 0 AND a.exercise_id IN (SELECT id FROM exercises WHERE curriculum_id = ?1)"
    " AND a.trainee";

/// An attempt's position in time order.
struct Key {
  std::int64_t started_ns = 0, number = 0;
};
/// The key of an attempt by this trainee, in this exercise if one is given. kNotFound.
Result<Key> keyOf(Connection& connection, std::string_view trainee, std::string_view exercise_id,
                  const Uuid& session) {
  ASSIGN_OR_RETURN(const auto key,
                   connection
                       .query("SELECT started_unix_ns, number FROM sessions WHERE id = ?3 AND trainee = ?1"
                              " AND (?2 = '' OR exercise_id = ?2)"
                              " AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number)",
                              trainee, exercise_id, ByteView(session))
                       .first([](const Statement& row) {
                         return Key{row.integer(0), row.integer(1)};
                       }));
  return key ? Result<Key>(*key) : unknownSession(session);
}

constexpr std::string_view kStanding =
    "SELECT exercise_id, attempts, counted, judged, passed FROM attempt_sums ";

std::pair<std::string, AttemptStanding> standingOfRow(const Statement& row) {
  AttemptStanding standing;
  standing.all = row.natural32(1);
  standing.counted = row.natural32(2);
  if (row.integer(3) > 0) standing.passed = row.integer(4) > 0;
  return {row.text(0), standing};
}

}  // namespace

pb::Attempt attemptOf(const Statement& row, bool with_score) {
  pb::Attempt attempt;
  attempt.set_session_id(row.text(0));
  attempt.set_trainee(row.text(1));
  attempt.set_trainee_full_name(row.text(1));
  attempt.set_exercise_id(row.text(2));
  attempt.set_number(row.natural32(3));
  attempt.set_started_unix_ns(row.integer(4));
  if (!row.isNull(5)) attempt.set_passed(row.integer(5) != 0);
  attempt.set_state(static_cast<pb::SessionState>(row.integer(6)));
  attempt.set_excused(row.integer(7) != 0);
  attempt.set_beyond(row.integer(7) == 2);
  attempt.set_profile_revision(row.natural32(8));
  attempt.set_engine_version(row.text(9));
  if (with_score) attempt.set_score_json(row.text(10));
  return attempt;
}

Result<std::uint32_t> attemptsUpTo(Connection& connection, std::string_view trainee,
                                   std::string_view exercise_id, std::int64_t started_unix_ns,
                                   std::int64_t number) {
  auto row = connection.query(
      "SELECT count(*) FROM sessions WHERE trainee = ? AND exercise_id = ?"
      " AND (started_unix_ns, number) <= (?, ?)"
      " AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number)",
      trainee, exercise_id, started_unix_ns, number);
  ASSIGN_OR_RETURN(const bool there, row.step());
  return there ? row.natural32(0) : 0;
}

Result<std::vector<pb::Attempt>> AttemptStore::list(std::string_view trainee, std::string_view exercise_id,
                                                    bool with_scores) {
  return connection_.query(attemptsAt(kPlaces, kInOrder, with_scores), trainee, exercise_id)
      .all([&](const Statement& row) { return attemptOf(row, with_scores); });
}

Result<std::vector<pb::Attempt>> AttemptStore::page(std::string_view trainee, std::string_view exercise_id,
                                                    const std::optional<Uuid>& after, std::size_t most) {
  Key key{INT64_MIN, 0};
  if (after) {
    ASSIGN_OR_RETURN(key, keyOf(connection_, trainee, exercise_id, *after));
  }
  const auto withScore = [](const Statement& row) { return attemptOf(row, true); };
  const auto max_rows = static_cast<std::uint64_t>(most);
  if (!exercise_id.empty()) {
    std::uint32_t before = 0;
    if (after) {
      ASSIGN_OR_RETURN(before, attemptsUpTo(connection_, trainee, exercise_id, key.started_ns, key.number));
    }
    return connection_
        .query(attemptsAt(kPlacesBehind, kInOrder, true), trainee, exercise_id, key.started_ns, key.number,
               std::uint64_t{before}, max_rows)
        .all(withScore);
  }
  const std::string places = fmt::format(
      "SELECT * FROM ({}) AS places WHERE (started_unix_ns, number) > (?4, ?5)"
      " ORDER BY started_unix_ns, number LIMIT ?6",
      kPlaces);
  // third value empty: no uncounted session is included
  return connection_
      .query(attemptsAt(places, kInOrder, true), trainee, exercise_id, ByteView(), key.started_ns, key.number,
             max_rows)
      .all(withScore);
}

Result<std::vector<pb::Attempt>> AttemptStore::newestPage(std::string_view trainee,
                                                          std::string_view exercise_id,
                                                          const std::optional<Uuid>& before,
                                                          std::size_t most) {
  Key key{INT64_MAX, INT64_MAX};
  std::uint32_t behind = 0;  // attempts from the page's first one back to the oldest
  if (before) {
    ASSIGN_OR_RETURN(key, keyOf(connection_, trainee, exercise_id, *before));
    ASSIGN_OR_RETURN(behind, attemptsUpTo(connection_, trainee, exercise_id, key.started_ns, key.number));
    --behind;
  } else {
    ASSIGN_OR_RETURN(const auto all, standing(trainee, exercise_id));
    behind = all.all;
  }
  return connection_
      .query(attemptsAt("SELECT number, ?5 + 1 - row_number() OVER (ORDER BY started_unix_ns DESC, number"
                        " DESC) AS place FROM (SELECT number, started_unix_ns FROM sessions"
                        " WHERE trainee = ?1 AND exercise_id = ?2 AND trainee <> ''"
                        " AND (started_unix_ns, number) < (?3, ?4)"
                        " AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number)"
                        " ORDER BY started_unix_ns DESC, number DESC LIMIT ?6) AS these",
                        "ORDER BY s.started_unix_ns DESC, s.number DESC", true),
             trainee, exercise_id, key.started_ns, key.number, std::uint64_t{behind},
             static_cast<std::uint64_t>(most))
      .all([](const Statement& row) { return attemptOf(row, true); });
}

Result<std::vector<TriedExercise>> AttemptStore::tried(std::string_view trainee, std::size_t most) {
  return connection_
      .query(
          "SELECT exercise_id, attempts, (SELECT s.started_unix_ns FROM sessions s WHERE s.trainee = "
          "a.trainee"
          " AND s.exercise_id = a.exercise_id"
          " AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = s.number)"
          " ORDER BY s.started_unix_ns DESC, s.number DESC LIMIT 1) AS newest FROM attempt_sums a"
          " WHERE trainee = ? AND attempts > 0 ORDER BY newest DESC, exercise_id LIMIT ?",
          trainee, static_cast<std::uint64_t>(most))
      .all([](const Statement& row) {
        return TriedExercise{row.text(0), row.natural32(1), row.integer(2)};
      });
}

Result<std::vector<NewestScore>> AttemptStore::newestScores(std::string_view trainee,
                                                            std::string_view exercise_id, std::size_t most) {
  ASSIGN_OR_RETURN(const auto all, standing(trainee, exercise_id));
  return connection_
      .query(
          "SELECT ?4 - p.newer, c.definition_version, c.measures FROM"
          " (SELECT number, row_number() OVER (ORDER BY started_unix_ns DESC, number DESC) AS newer FROM"
          " (SELECT number, started_unix_ns FROM sessions WHERE trainee = ?1 AND exercise_id = ?2"
          " AND trainee <> '' AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number)"
          " ORDER BY started_unix_ns DESC, number DESC LIMIT ?3) AS these) p"
          " JOIN sessions s ON s.number = p.number JOIN scores c ON c.session = p.number"
          " WHERE s.excused = 0 AND s.state <> 1 AND c.definition_version ="
          " (SELECT max(v.definition_version) FROM scores v WHERE v.session = p.number)"
          " ORDER BY p.newer DESC",
          trainee, exercise_id, static_cast<std::uint64_t>(most), std::uint64_t{all.all} + 1)
      .all([](const Statement& row) {
        return NewestScore{row.natural32(0), row.natural32(1), row.text(2)};
      });
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

Result<bool> AttemptStore::isUncounted(const Uuid& session) {
  ASSIGN_OR_RETURN(const auto found,
                   connection_
                       .query("SELECT 1 FROM uncounted_sessions u JOIN sessions s ON s.number = u.session"
                              " WHERE s.id = ?",
                              ByteView(session))
                       .first([](const Statement& row) { return row.integer(0); }));
  return found.has_value();
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

Result<AttemptStore::Standings> AttemptStore::standingsOf(std::span<const std::string> trainees,
                                                          std::span<const std::string> exercises) {
  Statement rows = connection_.prepare(
      "SELECT exercise_id, attempts, counted, judged, passed, trainee"
      " FROM attempt_sums WHERE trainee" +
      amongTexts(connection_, 1) + " AND exercise_id" + amongTexts(connection_, 2));
  bindTexts(connection_, rows, trainees);
  bindTexts(connection_, rows, exercises);
  Standings standings;
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return standings;
    standings[rows.text(5)].insert(standingOfRow(rows));
  }
}

Result<AttemptStore::BestAttempts> AttemptStore::best(std::span<const std::string> trainees,
                                                      std::string_view course_id, bool with_scores) {
  Statement rows =
      connection_.query(fmt::format("{}{}{}{}", kBestColumns, with_scores ? ", s.score_json" : "", kBest,
                                    amongTexts(connection_, 2)),
                        course_id);
  bindTexts(connection_, rows, trainees);
  BestAttempts best;
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return best;
    pb::Attempt attempt = attemptOf(rows, with_scores);
    std::string exercise = attempt.exercise_id();
    best[attempt.trainee()].emplace(std::move(exercise), std::move(attempt));
  }
}

namespace {

/// Values of sessions.excused.
constexpr int kExcused = 1, kBeyond = 2;

/// The numbers of the attempts in ?1, {}, that are beyond the exam's limit in order of start; none if the
/// exercise is not an exam.
constexpr std::string_view kBeyondExam =
    "SELECT number FROM (SELECT number, row_number() OVER (PARTITION BY trainee"
    " ORDER BY started_unix_ns, number) AS place FROM sessions WHERE exercise_id = ?1 AND {}"
    " AND trainee <> '' AND excused <> 1 AND erased = 0"
    " AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number)) AS places"
    " WHERE place > (SELECT exam_attempts FROM exercises WHERE id = ?1)";

}  // namespace

Status AttemptStore::countExam(std::string_view exercise_id, std::string_view trainee) {
  // all trainees, or one of them by the index of attempts
  const std::string of = trainee.empty() ? "trainee <> ?2" : "trainee = ?2";
  const std::string beyond = fmt::format(kBeyondExam, of);
  RETURN_IF_ERROR(connection_.run(fmt::format("UPDATE sessions SET excused = {} WHERE exercise_id = ?1 AND {}"
                                              " AND excused = 0 AND number IN ({})",
                                              kBeyond, of, beyond),
                                  exercise_id, trainee));
  return connection_.run(fmt::format("UPDATE sessions SET excused = 0 WHERE exercise_id = ?1 AND {}"
                                     " AND excused = {} AND number NOT IN ({})",
                                     of, kBeyond, beyond),
                         exercise_id, trainee);
}

Result<bool> AttemptStore::excuse(const Uuid& session, bool excused) {
  struct Row {
    std::string trainee, exercise_id;
    int excused = 0;
  };
  const auto now = [&] {
    return connection_
        .query("SELECT trainee, exercise_id, excused FROM sessions WHERE id = ?", ByteView(session))
        .first([](const Statement& row) {
          return Row{row.text(0), row.text(1), static_cast<int>(row.integer(2))};
        });
  };
  ASSIGN_OR_RETURN(const auto before, now());
  if (!before) return unknownSession(session);
  if ((before->excused == kExcused) == excused && before->excused != kBeyond) return false;
  RETURN_IF_ERROR(connection_.run("UPDATE sessions SET excused = ? WHERE id = ?", excused ? kExcused : 0,
                                  ByteView(session)));
  RETURN_IF_ERROR(countExam(before->exercise_id, before->trainee));
  ASSIGN_OR_RETURN(const auto after, now());
  if (!excused && after && after->excused == kBeyond)
    return Error{ErrorCode::kInvalidInput,
                 "session " + uuidText(session) +
                     " is beyond the attempts of the exam: those that began first count. Excuse one of "
                     "them, and it counts in its place"};
  return true;
}

}  // namespace needlelab
