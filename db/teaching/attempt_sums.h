/// Sums of trainees' attempts (migrations/0001_first.sql), and who takes a course. The cost depends on what
/// is requested, not on the number of stored sessions. The schema's triggers maintain the sums.
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
#include "db/store/connection.h"

namespace needlelab {

/// A trainee in a list by name. `ref`: of a person or a typed name, or kGuestName.
struct CourseTrainee {
  std::string ref, name;
  bool operator<(const CourseTrainee& other) const {
    return std::tie(name, ref) < std::tie(other.name, other.ref);
  }
};

/// Who takes a course: the group's members or, if no group is given, everyone with an attempt at one of its
/// exercises (including attempts that count for no one), everyone to whom it or one of its exercises is
/// assigned, and members of such groups. For a course by assignment only, attempts that count for no one are
/// ignored, and kGuestName is omitted. Does not own the connection. Thread: as its Connection; related calls
/// should share one view.
class CourseTrainees {
 public:
  /// The group must exist.
  CourseTrainees(Connection& connection, std::string course_id, std::string group_id)
      : connection_(connection), course_id_(std::move(course_id)), group_id_(std::move(group_id)) {}

  /// Those after `after`, by name; at most `most`.
  Result<std::vector<CourseTrainee>> page(const CourseTrainee& after, std::size_t most);
  /// How many there are. Reads each name once per exercise and group, but no sessions.
  Result<std::uint32_t> count();
  /// How many of them passed, by exercise of the course; exercises that no one passed are omitted.
  Result<std::map<std::string, std::uint32_t>> passed();

 private:
  Result<bool> isAssignedOnly();
  Connection& connection_;
  const std::string course_id_, group_id_;
};

/// A trainee's sums for an exercise that differ from a full count of the sessions.
struct SumFault {
  std::string exercise_id, trainee;
  std::string text;  ///< human-readable: by how much they differ
};

/// Does not own the connection. Thread: as its Connection.
class AttemptSums {
 public:
  explicit AttemptSums(Connection& connection) : connection_(connection) {}

  /// Compares all sums with the sessions; returns at most `most`, by exercise and trainee. Reads all
  /// sessions' rows.
  Result<std::vector<SumFault>> faults(std::size_t most);
  /// Recounts the trainee's sessions for the exercise. Needs the writer's connection and a transaction.
  Status recount(std::string_view exercise_id, std::string_view trainee);

 private:
  Connection& connection_;
};

}  // namespace needlelab
