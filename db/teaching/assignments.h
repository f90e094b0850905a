/// Assignments with their due dates.
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
#include "db/store/connection.h"
#include "needlelab/control.pb.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// Does not own the connection. Thread: as its Connection; changes need the writer's.
class AssignmentStore {
 public:
  explicit AssignmentStore(Connection& connection) : connection_(connection) {}

  /// Stores the assignment and returns it with its id. Replaces due, by and created if the same pair is
  /// already assigned. Ignores `assignment.id`. kInvalidInput: not exactly one of course and exercise and one
  /// of group and trainee, a person who is not a trainee, a date out of range; kNotFound: one of them does
  /// not exist.
  Result<pb::Assignment> put(const pb::Assignment& assignment);
  /// Returns the removed assignment. kNotFound.
  Result<pb::Assignment> remove(std::uint64_t id);

  struct Filter {
    std::string trainee = {};    ///< also returns assignments of the trainee's groups
    std::string course_id = {};  ///< also returns assignments of the course's exercises
    std::string group_id = {};
    std::uint64_t below = 0;  ///< only ids below this, i.e. older ones; 0: from the newest on
    std::uint64_t most = 0;   ///< 0: all
  };
  /// Newest first, groups with their names; empty filters mean all.
  Result<std::vector<pb::Assignment>> list(const Filter& filter);

  /// Whether the exercise or its course is assigned to the trainee or one of their groups.
  Result<bool> isAssigned(std::string_view trainee, std::string_view exercise_id, std::string_view course_id);
  /// Whether the course or one of its exercises is assigned to the trainee or one of their groups.
  Result<bool> isAssignedOf(std::string_view trainee, std::string_view course_id);

  /// The due date of an exercise for a trainee; 0: none. Precedence: the exercise assigned to the trainee,
  /// the course assigned to the trainee, the exercise assigned to a group, the course assigned to a group,
  /// `otherwise`. With several groups the latest date counts. A date for one person is an exception from the
  /// group's date. Reads only the assignments of this exercise and this course.
  Result<std::int64_t> dueOf(std::string_view trainee, std::string_view exercise_id,
                             std::string_view course_id, std::int64_t otherwise);

 private:
  Connection& connection_;
};

/// The dates that assignments set for the exercises of one course, for successive batches of trainees. Caches
/// groups' dates, so that further members cost no read. Does not own the connection. Thread: as its
/// Connection; all calls within one view.
class CourseDates {
 public:
  /// `exercise_ids`: the course's exercises.
  CourseDates(Connection& connection, std::string course_id, const std::vector<std::string>& exercise_ids);

  /// Reads what of() needs for these trainees: two statements, plus one for all groups not seen before. Drops
  /// the data of earlier trainees, except their groups'.
  Status readFor(std::span<const std::string> trainees);
  /// By exercise, in the order of `exercise_ids`, as AssignmentStore::dueOf() returns; 0: no assignment sets
  /// a date. A trainee outside the last readFor() is read first.
  Result<std::vector<std::int64_t>> of(const std::string& trainee);
  /// Number of dates read from the database so far.
  [[nodiscard]] std::uint64_t read() const { return read_; }

 private:
  /// Dates of a group, or of a trainee alone. 0: none.
  struct Dates {
    std::int64_t course_ns = 0;
    std::vector<std::pair<std::size_t, std::int64_t>> exercises_ns;  ///< by index in `exercise_ids`
  };
  /// By name, for each of `names`. `whose`: the column that holds the names.
  Result<std::map<std::string, Dates>> datesWhere(std::string_view whose, std::span<const std::string> names);

  Connection& connection_;
  const std::string course_id_;
  std::map<std::string, std::size_t> places_;                  ///< of the exercises, by id
  std::map<std::string, Dates> groups_;                        ///< by id
  std::map<std::string, Dates> own_;                           ///< of the last readFor()'s trainees, by name
  std::map<std::string, std::vector<std::string>> groups_of_;  ///< ids of their groups
  std::size_t kept_ = 0;                                       ///< dates in `groups_`
  std::uint64_t read_ = 0;
};

}  // namespace needlelab
