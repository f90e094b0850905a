#include "db/assignments.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <set>
#include <utility>

#include "db/documents.h"
#include "db/people.h"
#include "db/session_rows.h"
#include "db/text_lists.h"

namespace needlelab {
namespace {

constexpr std::size_t kMostDatesKept = 1 << 20;  // of groups; 16 bytes each

constexpr std::string_view kAssignment =
    "SELECT id, course_id, exercise_id, group_id, trainee, due_unix_ns, by_whom,"
    " created_unix_ns, coalesce((SELECT g.name FROM groups g WHERE g.id = group_id), '') FROM assignments ";

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
  found.set_group_name(row.text(8));
  return found;
}

Status checkTrainee(Connection& connection, const std::string& name) {
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection).find(name));
  if (!person) return Error{ErrorCode::kNotFound, "there is no person named '" + name + "'"};
  if (person->role != pb::TRAINEE)
    return Error{ErrorCode::kInvalidInput, "'" + name + "' is no trainee: exercises are for trainees"};
  return {};
}

/// Without sessions that count for nobody (migrations/0001_first.sql); ?3 may name one that is wanted
/// all the same. The places come of the keys alone: descriptions and scores are read of the rows that are
/// wanted.
constexpr std::string_view kPlaces =
    "SELECT number, started_unix_ns, row_number() OVER (PARTITION BY trainee, exercise_id"
    " ORDER BY started_unix_ns, number) AS place FROM sessions WHERE trainee = ?1"
    " AND (?2 = '' OR exercise_id = ?2) AND trainee <> ''"
    " AND (id = ?3 OR NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number))";

/// The attempts of these places; `rest` goes behind. A score that is not wanted is not read.
std::string attemptsAt(std::string_view places, std::string_view rest, bool with_score) {
  return fmt::format("SELECT {}, {} FROM ({}) p JOIN sessions s ON s.number = p.number {}", kAttemptColumns,
                     with_score ? "s.score_json" : "NULL", places, rest);
}
constexpr std::string_view kInOrder = "ORDER BY s.started_unix_ns, s.number";

/// The best attempt at each exercise of course ?1 of the trainees ?2, whose list goes behind: the last entry
/// of sessions_by_verdict, whose terms these are (migrations/0001_first.sql). Between the two parts: the
/// column of the score, where it is wanted.
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

/// Where an attempt stands in the order of time.
struct Key {
  std::int64_t started_ns = 0, number = 0;
};
/// Of an attempt of this trainee, at this exercise if one is given. kNotFound.
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
                 " AND id < ?4 ORDER BY id DESC LIMIT ?5",
             filter.trainee, filter.course_id, filter.group_id,
             filter.below == 0 ? std::uint64_t{INT64_MAX} : filter.below,
             filter.most == 0 ? std::uint64_t{INT64_MAX} : filter.most)
      .all(assignmentOf);
}

namespace {

/// Of trainee ?1.
constexpr std::string_view kOfTrainee =
    "(trainee = ?1 OR group_id IN (SELECT group_id FROM group_members WHERE person = ?1))";

Result<bool> thereIsOne(Result<std::optional<std::int64_t>> found) {
  if (!found) return found.error();
  return found->has_value();
}

std::int64_t firstInteger(const Statement& row) {
  return row.integer(0);
}

}  // namespace

Result<bool> AssignmentStore::isAssigned(std::string_view trainee, std::string_view exercise_id,
                                         std::string_view course_id) {
  return thereIsOne(connection_
                        .query(fmt::format("SELECT 1 FROM assignments WHERE {} AND (exercise_id = ?2"
                                           " OR course_id = ?3) LIMIT 1",
                                           kOfTrainee),
                               trainee, exercise_id, course_id)
                        .first(firstInteger));
}

Result<bool> AssignmentStore::isAssignedOf(std::string_view trainee, std::string_view course_id) {
  return thereIsOne(
      connection_
          .query(fmt::format("SELECT 1 FROM assignments WHERE {} AND (course_id = ?2 OR exercise_id IN"
                             " (SELECT id FROM exercises WHERE curriculum_id = ?2)) LIMIT 1",
                             kOfTrainee),
                 trainee, course_id)
          .first(firstInteger));
}

Result<std::int64_t> AssignmentStore::dueOf(std::string_view trainee, std::string_view exercise_id,
                                            std::string_view course_id, std::int64_t otherwise) {
  // the terms of assignments_once, so that no other assignment is looked at
  ASSIGN_OR_RETURN(
      const auto due,
      connection_
          .query("SELECT due_unix_ns FROM assignments WHERE coalesce(course_id, '') IN ('', ?3)"
                 " AND coalesce(exercise_id, '') IN ('', ?2) AND due_unix_ns IS NOT NULL"
                 " AND (trainee = ?1 OR group_id IN (SELECT group_id FROM group_members WHERE person = ?1))"
                 " ORDER BY CASE WHEN trainee IS NULL THEN 1 ELSE 0 END,"
                 " CASE WHEN exercise_id IS NULL THEN 1 ELSE 0 END, due_unix_ns DESC LIMIT 1",
                 trainee, exercise_id, course_id)
          .first([](const Statement& row) { return row.integer(0); }));
  return due.value_or(otherwise);
}

CourseDates::CourseDates(Connection& connection, std::string course_id,
                         const std::vector<std::string>& exercise_ids)
    : connection_(connection), course_id_(std::move(course_id)) {
  for (std::size_t i = 0; i < exercise_ids.size(); ++i) places_.emplace(exercise_ids[i], i);
}

Result<std::map<std::string, CourseDates::Dates>> CourseDates::datesWhere(
    std::string_view whose, std::span<const std::string> names) {
  std::map<std::string, Dates> all;
  for (const std::string& name : names) all.emplace(name, Dates());
  Statement row = connection_.query(
      fmt::format("SELECT exercise_id, due_unix_ns, {0} FROM assignments WHERE due_unix_ns IS NOT NULL"
                  " AND (course_id = ?1 OR EXISTS (SELECT 1 FROM exercises e WHERE e.id = exercise_id"
                  " AND e.curriculum_id = ?1)) AND {0}{1}",
                  whose, amongTexts(connection_, 2)),
      course_id_);
  bindTexts(connection_, row, names);
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, row.step());
    if (!more) return all;
    ++read_;
    Dates& dates = all[row.text(2)];
    if (row.isNull(0)) {
      dates.course_ns = std::max(dates.course_ns, row.integer(1));
    } else if (const auto place = places_.find(row.text(0)); place != places_.end()) {
      dates.exercises_ns.emplace_back(place->second, row.integer(1));
    }
  }
}

Status CourseDates::readFor(std::span<const std::string> trainees) {
  ASSIGN_OR_RETURN(own_, datesWhere("trainee", trainees));
  ASSIGN_OR_RETURN(groups_of_, GroupStore(connection_).groupsOfMany(trainees));
  if (kept_ > kMostDatesKept) {
    groups_.clear();
    kept_ = 0;
  }
  std::set<std::string> unread;
  for (const auto& [trainee, groups] : groups_of_)
    for (const std::string& group : groups)
      if (!groups_.contains(group)) unread.insert(group);
  if (unread.empty()) return {};
  const std::vector<std::string> ids(unread.begin(), unread.end());
  ASSIGN_OR_RETURN(auto dates, datesWhere("group_id", ids));
  for (const auto& [group, some] : dates) kept_ += some.exercises_ns.size();
  groups_.merge(dates);
  return {};
}

Result<std::vector<std::int64_t>> CourseDates::of(const std::string& trainee) {
  if (!own_.contains(trainee)) RETURN_IF_ERROR(readFor(std::span(&trainee, 1)));
  const Dates& own = own_[trainee];
  std::vector<std::int64_t> dates(places_.size());
  const auto addLatest = [&](const Dates& some) {
    for (const auto& [place, due_ns] : some.exercises_ns) dates[place] = std::max(dates[place], due_ns);
  };
  // what goes before comes last
  std::int64_t of_course_ns = 0;
  for (const std::string& group : groups_of_[trainee]) {
    const Dates& some = groups_[group];
    of_course_ns = std::max(of_course_ns, some.course_ns);
    addLatest(some);
  }
  for (std::int64_t& date : dates) {
    if (own.course_ns != 0) {
      date = own.course_ns;
    } else if (date == 0) {
      date = of_course_ns;
    }
  }
  for (const auto& [place, due_ns] : own.exercises_ns) dates[place] = 0;
  addLatest(own);
  return dates;
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
  const auto most_rows = static_cast<std::uint64_t>(most);
  if (!exercise_id.empty()) {
    std::uint32_t before = 0;
    if (after) {
      ASSIGN_OR_RETURN(before, attemptsUpTo(connection_, trainee, exercise_id, key.started_ns, key.number));
    }
    return connection_
        .query(attemptsAt(kPlacesBehind, kInOrder, true), trainee, exercise_id, key.started_ns, key.number,
               std::uint64_t{before}, most_rows)
        .all(withScore);
  }
  const std::string places = fmt::format(
      "SELECT * FROM ({}) AS places WHERE (started_unix_ns, number) > (?4, ?5)"
      " ORDER BY started_unix_ns, number LIMIT ?6",
      kPlaces);
  // the third value: nothing is wanted all the same
  return connection_
      .query(attemptsAt(places, kInOrder, true), trainee, exercise_id, ByteView(), key.started_ns, key.number,
             most_rows)
      .all(withScore);
}

Result<std::vector<pb::Attempt>> AttemptStore::newestPage(std::string_view trainee,
                                                          std::string_view exercise_id,
                                                          const std::optional<Uuid>& before,
                                                          std::size_t most) {
  Key key{INT64_MAX, INT64_MAX};
  std::uint32_t behind = 0;  // attempts from the page's first one down to the oldest
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

/// sessions.excused.
constexpr int kExcused = 1, kBeyond = 2;

/// The numbers of the attempts at ?1, {}, that are in order of start beyond as many as the exam allows; of an
/// exercise that is no exam: none.
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
