/// Assignments with their due dates, and trainees' attempts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "needlelab/control.pb.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// Does not own the connection. Thread: as its Connection; changes need the writer's.
class AssignmentStore {
 public:
  explicit AssignmentStore(Connection& connection) : connection_(connection) {}

  /// Stores the assignment and returns it with its id. Replaces due, by and created when the same pair is
  /// already assigned. Ignores `id` of the argument. kInvalidInput: not exactly one of course and exercise
  /// and one of group and trainee, a person who is not a trainee, a date out of range; kNotFound: one of them
  /// does not exist.
  Result<pb::Assignment> put(const pb::Assignment& assignment);
  /// Returns the removed assignment. kNotFound.
  Result<pb::Assignment> remove(std::uint64_t id);

  struct Filter {
    std::string trainee = {};    ///< also returns assignments of the trainee's groups
    std::string course_id = {};  ///< also returns assignments of the course's exercises
    std::string group_id = {};
    std::uint64_t below = 0;  ///< an id: those older than this one; 0: from the newest on
    std::uint64_t most = 0;   ///< 0: all
  };
  /// Newest first, groups with their names; empty filters mean all.
  Result<std::vector<pb::Assignment>> list(const Filter& filter);

  /// Whether the exercise or its course is assigned to the trainee, or to a group of theirs.
  Result<bool> isAssigned(std::string_view trainee, std::string_view exercise_id, std::string_view course_id);
  /// Whether the course, or one of its exercises, is.
  Result<bool> isAssignedOf(std::string_view trainee, std::string_view course_id);

  /// Returns the due date of an exercise for a trainee; 0: never due. Order of precedence: the exercise
  /// assigned to the trainee, the course assigned to the trainee, the exercise assigned to a group, the
  /// course assigned to a group, `otherwise`. With several groups the latest date counts. A date for one
  /// person is an exception from the group's date. Looks at the assignments of this exercise and this course
  /// alone.
  Result<std::int64_t> dueOf(std::string_view trainee, std::string_view exercise_id,
                             std::string_view course_id, std::int64_t otherwise);

 private:
  Connection& connection_;
};

/// The dates that assignments set for the exercises of one course, for some trainees after others. Keeps the
/// dates of a group, so that the next members cost no read of them. Does not own the connection. Thread: as
/// its Connection; all calls within one view.
class CourseDates {
 public:
  /// `exercise_ids`: of the course.
  CourseDates(Connection& connection, std::string course_id, const std::vector<std::string>& exercise_ids);

  /// Reads what of() needs for these trainees, in two statements, and one for all groups that nobody before
  /// was in. What was read for others goes, but for their groups.
  Status readFor(std::span<const std::string> trainees);
  /// By exercise, in the order of `exercise_ids`, as AssignmentStore::dueOf() says; 0: no assignment sets a
  /// date. Of a trainee of the last readFor(), or of any other, after a readFor() of that one.
  Result<std::vector<std::int64_t>> of(const std::string& trainee);
  /// How many dates were read of the database so far.
  [[nodiscard]] std::uint64_t read() const { return read_; }

 private:
  /// Of a group or of a trainee alone. 0: none.
  struct Dates {
    std::int64_t course_ns = 0;
    std::vector<std::pair<std::size_t, std::int64_t>> exercises_ns;  ///< by place in `exercise_ids`
  };
  /// Of each of the names, by name. `whose`: the column of the names.
  Result<std::map<std::string, Dates>> datesWhere(std::string_view whose, std::span<const std::string> names);

  Connection& connection_;
  const std::string course_id_;
  std::map<std::string, std::size_t> places_;                  ///< of the exercises, by id
  std::map<std::string, Dates> groups_;                        ///< by id
  std::map<std::string, Dates> own_;                           ///< of the trainees of readFor(), by name
  std::map<std::string, std::vector<std::string>> groups_of_;  ///< ids of their groups
  std::size_t kept_ = 0;                                       ///< dates in `groups_`
  std::uint64_t read_ = 0;
};

/// A trainee's result in an exercise. Attempts are the trainee's sessions in it, numbered by start time.
/// Sessions that came before anybody had the name are not among them, until a manager assigns them.
struct AttemptStanding {
  std::uint32_t counted = 0;  ///< attempts that are neither excused nor beyond those of an exam
  std::uint32_t all = 0;
  std::optional<bool> passed;  ///< any attempt that is not excused; nothing: no attempt has a verdict
};

/// An attempt's score by its newest definitions.
struct NewestScore {
  std::uint32_t number = 0;  ///< of the attempt
  std::uint32_t version = 0;
  std::string measures_json;
};

/// An exercise at which a trainee has attempts.
struct TriedExercise {
  std::string exercise_id;
  std::uint32_t attempts = 0;  ///< excused ones, too
  std::int64_t newest_unix_ns = 0;
};

/// Does not own the connection. Thread: as its Connection; changes need the writer's.
class AttemptStore {
 public:
  explicit AttemptStore(Connection& connection) : connection_(connection) {}

  /// Oldest first. Empty `exercise_id`: all exercises, numbered within each. The station's clock decides the
  /// order: when a station delivers an older session late, the numbers of the later ones move up.
  Result<std::vector<pb::Attempt>> list(std::string_view trainee, std::string_view exercise_id,
                                        bool with_scores);
  /// The same from behind the attempt `after` on (empty: from the first one), `most` of them at most. Reads
  /// the scores of these alone, and looks at the keys of those before to number them; of all exercises: at
  /// the keys of all. kNotFound: `after` is not among the attempts.
  Result<std::vector<pb::Attempt>> page(std::string_view trainee, std::string_view exercise_id,
                                        const std::optional<Uuid>& after, std::size_t most);
  /// At one exercise, newest first, from the one before `before` on (empty: from the newest one). The numbers
  /// come of the sums, or, behind an attempt, of the keys of those up to it. kNotFound: as page().
  Result<std::vector<pb::Attempt>> newestPage(std::string_view trainee, std::string_view exercise_id,
                                              const std::optional<Uuid>& before, std::size_t most);
  /// The exercise that was tried last first, `most` at most. Reads the sums, and one entry of an index for
  /// each.
  Result<std::vector<TriedExercise>> tried(std::string_view trainee, std::size_t most);
  /// Of those of the newest `most` attempts at one exercise that are closed and not excused, in order of
  /// their numbers, which come of the sums; the others have none.
  Result<std::vector<NewestScore>> newestScores(std::string_view trainee, std::string_view exercise_id,
                                                std::size_t most);
  /// Returns a session's attempt with its number; of one that waits for its trainee the number that it would
  /// have. kNotFound.
  Result<pb::Attempt> get(const Uuid& session);
  /// Whether the session counts for nobody: it waits for its trainee, or is of somebody who was erased.
  Result<bool> isUncounted(const Uuid& session);
  /// Reads sums (attempt_sums.h), however many attempts there are; and so do the next ones.
  Result<AttemptStanding> standing(std::string_view trainee, std::string_view exercise_id);
  /// In all exercises with a session under this name; in others: none.
  Result<std::map<std::string, AttemptStanding>> standings(std::string_view trainee);
  /// By trainee, then exercise: of these trainees in these exercises, in one statement.
  using Standings = std::map<std::string, std::map<std::string, AttemptStanding>>;
  Result<Standings> standingsOf(std::span<const std::string> trainees,
                                std::span<const std::string> exercises);
  /// The best attempt that counts at each exercise of the course, by trainee, then exercise; one statement:
  /// passed before not passed, then the most requirements met, then the newest; closed ones. Its number
  /// counts the attempts before it; all else looks at one entry of an index an exercise.
  using BestAttempts = std::map<std::string, std::map<std::string, pb::Attempt>>;
  Result<BestAttempts> best(std::span<const std::string> trainees, std::string_view course_id,
                            bool with_scores);
  /// Returns true when this changed something. kNotFound; kInvalidInput: it is beyond the attempts of an exam
  /// and cannot count while others before it do.
  Result<bool> excuse(const Uuid& session, bool excused);
  /// Of an exam's exercise the first attempts in order of start count, as many as it allows: marks those
  /// beyond them, however late they came, and takes the mark from all others. Those that somebody excused, or
  /// that count for nobody yet, are not among them. Empty `trainee`: all trainees.
  Status countExam(std::string_view exercise_id, std::string_view trainee = {});

 private:
  Connection& connection_;
};

}  // namespace needlelab
