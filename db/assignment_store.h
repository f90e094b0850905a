/// Who shall do what by when: a course or an exercise, for a group or a trainee.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class AssignmentStore {
 public:
  explicit AssignmentStore(Connection& connection) : connection_(connection) {}

  /// Stores it, or renews the one of the same pair (due, by, created): with its id. `id` of the argument is
  /// not read. kInvalidInput: not exactly one of course and exercise and one of group and trainee, no
  /// trainee, a date out of range; kNotFound: one of them is not there.
  Result<pb::Assignment> put(const pb::Assignment& assignment);
  /// Gives what was removed. kNotFound.
  Result<pb::Assignment> remove(std::uint64_t id);

  struct Filter {
    std::string trainee;    ///< its own, and those of its groups
    std::string course_id;  ///< of the course itself, and of its exercises
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

}  // namespace needlelab
