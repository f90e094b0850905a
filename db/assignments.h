/// Assignments with their due dates, and trainees' attempts.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "needlelab/control.pb.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// A date that an assignment sets: of a course or an exercise, for the trainee alone or a group.
struct DueRule {
  std::string course_id, exercise_id;  ///< one of them
  bool of_group = false;
  std::int64_t due_unix_ns = 0;
};

/// The date that counts for an exercise (AssignmentStore::dueOf()); `otherwise` when no rule is for it.
std::int64_t dueBy(std::span<const DueRule> rules, std::string_view exercise_id, std::string_view course_id,
                   std::int64_t otherwise);

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
    std::string trainee;    ///< also returns assignments of the trainee's groups
    std::string course_id;  ///< also returns assignments of the course's exercises
    std::string group_id;
  };
  /// Newest first; empty filters mean all.
  Result<std::vector<pb::Assignment>> list(const Filter& filter);

  /// Dates that apply to a trainee, own and of groups, of any course.
  Result<std::vector<DueRule>> dueRules(std::string_view trainee);
  /// Returns the due date of an exercise for a trainee; 0: never due. Order of precedence: the exercise
  /// assigned to the trainee, the course assigned to the trainee, the exercise assigned to a group, the
  /// course assigned to a group, `otherwise`. With several groups the latest date counts. A date for one
  /// person is an exception from the group's date.
  Result<std::int64_t> dueOf(std::string_view trainee, std::string_view exercise_id,
                             std::string_view course_id, std::int64_t otherwise);

 private:
  Connection& connection_;
};

/// A trainee's result in an exercise. Attempts are the trainee's sessions in it, numbered by start time.
/// Sessions that came before anybody had the name are not among them, until a manager assigns them.
struct AttemptStanding {
  std::uint32_t counted = 0;  ///< attempts that are not excused
  std::uint32_t all = 0;
  std::optional<bool> passed;  ///< any attempt that is not excused; nothing: no attempt has a verdict
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
  /// the scores of these alone. kNotFound: `after` is not among the attempts.
  Result<std::vector<pb::Attempt>> page(std::string_view trainee, std::string_view exercise_id,
                                        const std::optional<Uuid>& after, std::size_t most);
  /// Returns a session's attempt with its number. kNotFound.
  Result<pb::Attempt> get(const Uuid& session);
  /// Reads sums (attempt_sums.h), however many attempts there are; and so do the next ones.
  Result<AttemptStanding> standing(std::string_view trainee, std::string_view exercise_id);
  /// In all exercises with a session under this name; in others: none.
  Result<std::map<std::string, AttemptStanding>> standings(std::string_view trainee);
  /// The best attempt that counts at each exercise of the course: passed before not passed, then the most
  /// requirements met, then the newest; closed ones, without their scores. Its number counts the attempts
  /// before it; all else looks at one entry of an index an exercise.
  Result<std::map<std::string, pb::Attempt>> best(std::string_view trainee, std::string_view course_id);
  /// Returns true when this changed something. kNotFound.
  Result<bool> excuse(const Uuid& session, bool excused);

 private:
  Connection& connection_;
};

}  // namespace needlelab
