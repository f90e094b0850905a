/// What is left to do and who struggles, over all trainees: for the console's first page. The cost depends on
/// the number of assigned exercises and people, not on the number of stored sessions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

/// An exercise that is assigned to a person, alone or in a group, and that no counting attempt passed.
struct LeftExercise {
  std::string trainee, exercise_id;
  std::int64_t due_unix_ns = 0;  ///< as AssignmentStore::dueOf(); 0: no assignment sets a date
  std::uint32_t counted = 0;     ///< attempts that are neither excused nor beyond an exam's limit
};

/// A trainee who has not passed an exercise.
struct TriedInVain {
  std::string trainee, exercise_id;
  std::int64_t newest_unix_ns = 0;      ///< start of the newest of the attempts below
  std::vector<std::string> score_json;  ///< first scores of the newest attempts that count, newest first
};

/// Does not own the connection. Thread: as its Connection; both within one view.
class TodayStore {
 public:
  explicit TodayStore(Connection& connection) : connection_(connection) {}

  /// By name of the trainee, without people whose access has ended.
  Result<std::vector<LeftExercise>> left();
  /// Those with at least `in_a_row` attempts that have a verdict, tried at or after `since_unix_ns`, with
  /// `in_a_row` scores each; last tried first. Without people whose access has ended, and without exercises
  /// that no course has now.
  Result<std::vector<TriedInVain>> inVain(std::uint32_t in_a_row, std::int64_t since_unix_ns);

 private:
  Connection& connection_;
};

}  // namespace needlelab
