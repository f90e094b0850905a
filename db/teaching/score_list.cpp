#include "db/teaching/score_list.h"

#include <fmt/core.h>

#include <algorithm>

#include "common/base/text/text.h"
#include "db/people/person_refs.h"
#include "db/teaching/attempts.h"

namespace needlelab {
namespace {

constexpr std::uint64_t kAttemptsAtOnce = 64;

/// Exercises of course ?1, or all.
constexpr std::string_view kInCourse =
    "(?1 = '' OR exercise_id IN (SELECT id FROM exercises WHERE curriculum_id = ?1))";

/// Attempts of ?1 in ?2 after (?3, ?4) with their scores; without a score the version is NULL.
constexpr std::string_view kScored =
    "SELECT {}, s.number, c.definition_version, c.measures, c.passed, c.made_unix_ns, c.first,"
    " c.engine_version FROM ({}) p JOIN sessions s ON s.number = p.number"
    " LEFT JOIN scores c ON c.session = s.number ORDER BY s.started_unix_ns, s.number, c.definition_version";

}  // namespace

ScoreList::ScoreList(Connection& connection, ScoreKey after, std::string course_id, std::string group_id)
    : connection_(connection),
      course_id_(std::move(course_id)),
      group_id_(std::move(group_id)),
      key_(std::move(after)) {}

Status ScoreList::exercisesFrom(const std::string& first) {
  ASSIGN_OR_RETURN(exercises_,
                   connection_
                       .query(fmt::format("SELECT exercise_id FROM attempt_sums WHERE trainee = ?2"
                                          " AND exercise_id >= ?3 AND {}"
                                          " ORDER BY exercise_id DESC",
                                          kInCourse),
                              course_id_, trainee_, first)
                       .all(firstText));
  return {};
}

/// By name; guests come last.
Result<std::string> ScoreList::traineeBehind(const std::string& ref) {
  if (ref == kGuestName) return std::string();
  auto rows = connection_.query(
      fmt::format(
          "SELECT c.ref FROM called c WHERE c.name >= ?2 AND (c.name > ?2 OR c.ref > ?3)"
          " AND (?4 = '' OR EXISTS (SELECT 1 FROM group_members WHERE group_id = ?4 AND person = c.ref))"
          " AND c.ref NOT IN (SELECT ref FROM names_taken)"
          " AND EXISTS (SELECT 1 FROM attempt_sums WHERE trainee = c.ref AND {})"
          " ORDER BY c.name, c.ref LIMIT 1",
          kInCourse),
      course_id_, name_, ref, group_id_);
  ASSIGN_OR_RETURN(const auto found, rows.first(firstText));
  if (found) return *found;
  if (!group_id_.empty()) return std::string();
  ASSIGN_OR_RETURN(
      const auto tried,
      connection_
          .query(fmt::format("SELECT 1 FROM attempt_sums WHERE trainee = ?2 AND {} LIMIT 1", kInCourse),
                 course_id_, kGuestName)
          .first(firstText));
  return std::string(tried ? kGuestName : "");
}

/// Moves to the trainee and exercise where the list begins.
Status ScoreList::begin() {
  begun_ = true;
  trainee_ = key_.trainee;
  if (trainee_.empty()) return {};
  name_ = key_.name;
  if (!group_id_.empty()) {
    ASSIGN_OR_RETURN(
        const auto member,
        connection_
            .query("SELECT person FROM group_members WHERE group_id = ? AND person = ?", group_id_, trainee_)
            .first(firstText));
    if (!member) return {};
  }
  RETURN_IF_ERROR(exercisesFrom(key_.exercise_id));
  if (exercises_.empty() || exercises_.back() != key_.exercise_id) return {};
  exercises_.pop_back();
  // its attempt may have further versions
  pair_ = Pair{key_.exercise_id, key_.started_unix_ns, key_.number - 1};
  ASSIGN_OR_RETURN(pair_->place, attemptsUpTo(connection_, trainee_, key_.exercise_id, pair_->started_unix_ns,
                                              pair_->number));
  return {};
}

/// Moves to the next trainee and exercise with sessions; false at the end.
Result<bool> ScoreList::nextPair() {
  while (exercises_.empty()) {
    ASSIGN_OR_RETURN(trainee_, traineeBehind(trainee_));
    if (trainee_.empty()) return false;
    ASSIGN_OR_RETURN(name_, shownName(connection_, trainee_));
    RETURN_IF_ERROR(exercisesFrom(""));
  }
  pair_ = Pair{exercises_.back()};
  exercises_.pop_back();
  return true;
}

/// Reads the pair's next attempts into rows_.
Status ScoreList::readAttempts() {
  auto rows =
      connection_.query(fmt::format(kScored, kAttemptColumns, kPlacesBehind), trainee_, pair_->exercise_id,
                        pair_->started_unix_ns, pair_->number, std::uint64_t{pair_->place}, kAttemptsAtOnce);
  std::uint64_t attempts = 0;
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) break;
    Row read;
    read.number = rows.integer(10);
    pb::Attempt attempt = attemptOf(rows, false);
    if (attempts == 0 || read.number != pair_->number) ++attempts;
    pair_ = Pair{attempt.exercise_id(), attempt.started_unix_ns(), read.number, attempt.number()};
    if (rows.isNull(11)) continue;
    const std::uint32_t version = rows.natural32(11);
    if (read.number == key_.number && version <= key_.version) continue;  // already returned
    pb::Score& score = *read.row.mutable_score();
    score.set_session_id(attempt.session_id());
    score.set_definition_version(version);
    score.set_measures_json(rows.text(12));
    if (!rows.isNull(13)) score.set_passed(rows.integer(13) != 0);
    score.set_made_unix_ns(rows.integer(14));
    score.set_first(rows.integer(15) != 0);
    score.set_engine_version(rows.text(16));
    *read.row.mutable_attempt() = std::move(attempt);
    rows_.push_back(std::move(read));
  }
  std::reverse(rows_.begin(), rows_.end());
  if (attempts < kAttemptsAtOnce) pair_.reset();
  return {};
}

Result<std::optional<pb::ScoreRow>> ScoreList::next() {
  if (!begun_) RETURN_IF_ERROR(begin());
  while (rows_.empty()) {
    if (!pair_) {
      ASSIGN_OR_RETURN(const bool more, nextPair());
      if (!more) return std::optional<pb::ScoreRow>();
    }
    RETURN_IF_ERROR(readAttempts());
  }
  Row given = std::move(rows_.back());
  rows_.pop_back();
  const pb::Attempt& attempt = given.row.attempt();
  key_ = {attempt.trainee(),         attempt.exercise_id(), name_,
          attempt.started_unix_ns(), given.number,          given.row.score().definition_version()};
  return std::optional(std::move(given.row));
}

}  // namespace needlelab
