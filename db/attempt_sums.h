/// Sums of trainees' attempts (migrations/0001_first.sql), and who takes a course: work that grows
/// with what is asked for, not with the sessions that are stored. The schema's triggers keep the sums.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// A trainee in a list by name. `ref`: of a person or a typed name; or kGuestName.
struct CourseTrainee {
  std::string ref, name;
  bool operator<(const CourseTrainee& other) const {
    return std::tie(name, ref) < std::tie(other.name, other.ref);
  }
};

/// Who takes a course: the group's members; or, of an empty group, all with an attempt at one of its
/// exercises (also one that counts for nobody), all to whom it or one of its exercises is assigned, and
/// members of such groups. Of a course that is assigned only, attempts that count for nobody list no one, and
/// kGuestName is left out. Does not own the connection. Thread: as its Connection; several calls belong
/// into one view.
class CourseTrainees {
 public:
  /// The group must exist.
  CourseTrainees(Connection& connection, std::string course_id, std::string group_id)
      : connection_(connection), course_id_(std::move(course_id)), group_id_(std::move(group_id)) {}

  /// Those behind `after`, by name, `most` of them at most.
  Result<std::vector<CourseTrainee>> page(const CourseTrainee& after, std::size_t most);
  /// How many there are. Looks at each name once an exercise and group, not at sessions.
  Result<std::uint32_t> count();
  /// How many of them passed, by exercise of the course; exercises that nobody passed are left out.
  Result<std::map<std::string, std::uint32_t>> passed();

 private:
  Result<bool> isAssignedOnly();
  Connection& connection_;
  const std::string course_id_, group_id_;
};

/// A trainee's sums at an exercise that are not what a full count of the sessions gives.
struct SumFault {
  std::string exercise_id, trainee;
  std::string text;  ///< for a person: by how much they differ
};

/// Does not own the connection. Thread: as its Connection.
class AttemptSums {
 public:
  explicit AttemptSums(Connection& connection) : connection_(connection) {}

  /// Compares all sums with the sessions; `most` at most, by exercise and trainee. Reads all sessions' rows.
  Result<std::vector<SumFault>> faults(std::size_t most);
  /// Counts the trainee's sessions at the exercise anew. Wants the writer's connection and a transaction.
  Status recount(std::string_view exercise_id, std::string_view trainee);

 private:
  Connection& connection_;
};

}  // namespace needlelab
