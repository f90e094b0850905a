/// What trainees shall do by when, and their attempts at it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "needlelab/control.pb.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class AssignmentStore {
 public:
  explicit AssignmentStore(Connection& connection) : connection_(connection) {}

  /// Stores the assignment, or renews the one of the same pair (due, by, created), and gives it with its id.
  /// `id` of the argument is not read. kInvalidInput: not exactly one of course and exercise and one of group
  /// and trainee, a person who is not a trainee, a date out of range; kNotFound: one of them does not exist.
  Result<pb::Assignment> put(const pb::Assignment& assignment);
  /// Gives the removed assignment. kNotFound.
  Result<pb::Assignment> remove(std::uint64_t id);

  struct Filter {
    std::string trainee;    ///< assignments of the trainee and of its groups
    std::string course_id;  ///< of the course and of its exercises
    std::string group_id;
  };
  /// Newest first; empty filters mean all.
  Result<std::vector<pb::Assignment>> list(const Filter& filter);

  /// When an exercise is due for a trainee; 0: never. The exercise's own assignment to the trainee goes
  /// before the course's to the trainee, before the exercise's to a group, before the course's to a group (of
  /// several groups the latest), before `otherwise`: a date for one person is an exception from the group's.
  Result<std::int64_t> dueOf(std::string_view trainee, std::string_view exercise_id,
                             std::string_view course_id, std::int64_t otherwise);

 private:
  Connection& connection_;
};

/// How a trainee stands with an exercise. Attempts are the trainee's sessions at it, numbered by when they
/// began.
struct AttemptStanding {
  std::uint32_t counted = 0;  ///< attempts that are not excused
  std::uint32_t all = 0;
  std::optional<bool> passed;  ///< any attempt that is not excused; nothing: no attempt has a verdict
};

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class AttemptStore {
 public:
  explicit AttemptStore(Connection& connection) : connection_(connection) {}

  /// Oldest first. Empty `exercise_id`: of all exercises, numbered within each. Numbers count by the
  /// station's clock: a session that comes late from a station that was away takes its place, and those
  /// behind it move.
  Result<std::vector<pb::Attempt>> list(std::string_view trainee, std::string_view exercise_id,
                                        bool with_scores);
  /// The one of a session, numbered. kNotFound.
  Result<pb::Attempt> get(const Uuid& session);
  Result<AttemptStanding> standing(std::string_view trainee, std::string_view exercise_id);
  /// Names of trainees who have an attempt at any of a course's exercises.
  Result<std::vector<std::string>> trainees(std::string_view course_id);
  /// Gives true when this changed something. kNotFound.
  Result<bool> excuse(const Uuid& session, bool excused);

 private:
  Connection& connection_;
};

}  // namespace needlelab
