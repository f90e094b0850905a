/// Attempts: the sessions of a trainee at an exercise, numbered by when they were begun.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// How a trainee stands with an exercise.
struct AttemptStanding {
  std::uint32_t counted = 0;  ///< attempts that are not excused
  std::uint32_t all = 0;
  std::optional<bool> passed;  ///< any attempt that is not excused; nothing: none has a verdict
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
  /// kNotFound. Gives whether it was otherwise before.
  Result<bool> excuse(const Uuid& session, bool excused);

 private:
  Connection& connection_;
};

}  // namespace needlelab
