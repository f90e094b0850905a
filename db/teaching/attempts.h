/// Trainees' attempts: their sessions in an exercise, in order of their start.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/store/connection.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// A trainee's result in an exercise. Attempts are the trainee's sessions in it, numbered by start time.
/// Sessions that arrived before an account had the name are excluded until a manager assigns them.
struct AttemptStanding {
  std::uint32_t counted = 0;  ///< attempts that are neither excused nor beyond an exam's limit
  std::uint32_t all = 0;
  std::optional<bool> passed;  ///< by any attempt that is not excused; nothing: no attempt has a verdict
};

/// An attempt's score under its newest definitions.
struct NewestScore {
  std::uint32_t number = 0;  ///< the attempt's number
  std::uint32_t version = 0;
  std::string measures_json;
};

/// An exercise in which a trainee has attempts.
struct TriedExercise {
  std::string exercise_id;
  std::uint32_t attempts = 0;  ///< including excused ones
  std::int64_t newest_unix_ns = 0;
};

/// Does not own the connection. Thread: as its Connection; changes need the writer's.
class AttemptStore {
 public:
  explicit AttemptStore(Connection& connection) : connection_(connection) {}

  /// Oldest first. Empty `exercise_id`: all exercises, numbered within each. The station's clock determines
  /// the order: if a station delivers an older session late, the numbers of later ones move up.
  Result<std::vector<pb::Attempt>> list(std::string_view trainee, std::string_view exercise_id,
                                        bool with_scores);
  /// Same, but only at most `most` attempts after `after` (empty: from the first). Reads only their scores,
  /// and the keys of earlier attempts to number them; for all exercises, the keys of all. kNotFound: `after`
  /// is not among the attempts.
  Result<std::vector<pb::Attempt>> page(std::string_view trainee, std::string_view exercise_id,
                                        const std::optional<Uuid>& after, std::size_t most);
  /// In one exercise, newest first, starting before `before` (empty: with the newest). The numbers come from
  /// the sums or, given `before`, from counting the keys up to it. kNotFound: as page().
  Result<std::vector<pb::Attempt>> newestPage(std::string_view trainee, std::string_view exercise_id,
                                              const std::optional<Uuid>& before, std::size_t most);
  /// The most recently tried exercise first; at most `most`. Reads the sums, and one index entry per
  /// exercise.
  Result<std::vector<TriedExercise>> tried(std::string_view trainee, std::size_t most);
  /// Scores of those among the newest `most` attempts in one exercise that are closed and not excused,
  /// ordered by number (from the sums).
  Result<std::vector<NewestScore>> newestScores(std::string_view trainee, std::string_view exercise_id,
                                                std::size_t most);
  /// A session's attempt with its number; if it waits for its trainee, the number that it would have.
  /// kNotFound.
  Result<pb::Attempt> get(const Uuid& session);
  /// Whether the session counts for no one: it waits for its trainee, or belonged to someone who was erased.
  Result<bool> isUncounted(const Uuid& session);
  /// Reads sums (attempt_sums.h), however many attempts there are; the same holds for the next two.
  Result<AttemptStanding> standing(std::string_view trainee, std::string_view exercise_id);
  /// For all exercises with a session under this name; others have none.
  Result<std::map<std::string, AttemptStanding>> standings(std::string_view trainee);
  /// By trainee, then exercise; for these trainees in these exercises, in one statement.
  using Standings = std::map<std::string, std::map<std::string, AttemptStanding>>;
  Result<Standings> standingsOf(std::span<const std::string> trainees,
                                std::span<const std::string> exercises);
  /// The best counting attempt in each exercise of the course, by trainee, then exercise; in one statement.
  /// Order: passed before not passed, then most requirements met, then newest; only closed ones. Numbering
  /// counts the earlier attempts; otherwise only one index entry per exercise is read.
  using BestAttempts = std::map<std::string, std::map<std::string, pb::Attempt>>;
  Result<BestAttempts> best(std::span<const std::string> trainees, std::string_view course_id,
                            bool with_scores);
  /// Returns whether this changed anything. kNotFound; kInvalidInput: the attempt is beyond an exam's limit
  /// and cannot count while earlier ones do.
  Result<bool> excuse(const Uuid& session, bool excused);
  /// In an exam, the first attempts in order of start count, as many as it allows: marks those beyond,
  /// however late they arrived, and unmarks all others. Excused attempts, and those that count for no one
  /// yet, are not counted. Empty `trainee`: all trainees.
  Status countExam(std::string_view exercise_id, std::string_view trainee = {});

 private:
  Connection& connection_;
};

/// Columns for attemptOf(), from `sessions s` and a place `p`.
inline constexpr std::string_view kAttemptColumns =
    "s.id, s.trainee, s.exercise_id, p.place, s.started_unix_ns, s.passed, s.state, s.excused,"
    " s.profile_revision, s.engine_version";
/// An attempt from these columns; `with_score`: the score text is the next column.
pb::Attempt attemptOf(const Statement& row, bool with_score);
/// Numbers and places of the attempts of trainee ?1 in exercise ?2 that begin after (?3, ?4), given ?5
/// earlier attempts; at most ?6. Reads only their keys.
inline constexpr std::string_view kPlacesBehind =
    "SELECT number, ?5 + row_number() OVER (ORDER BY started_unix_ns, number) AS place FROM"
    " (SELECT number, started_unix_ns FROM sessions WHERE trainee = ?1 AND exercise_id = ?2 AND trainee <> ''"
    " AND (started_unix_ns, number) > (?3, ?4)"
    " AND NOT EXISTS (SELECT 1 FROM uncounted_sessions WHERE session = number)"
    " ORDER BY started_unix_ns, number LIMIT ?6) AS these";
/// Number of the trainee's attempts in the exercise up to this key, counted by keys.
Result<std::uint32_t> attemptsUpTo(Connection& connection, std::string_view trainee,
                                   std::string_view exercise_id, std::int64_t started_unix_ns,
                                   std::int64_t number);

}  // namespace needlelab
