/// All scores of trainees' attempts, in order and in pieces. The cost depends on what is read, not on what is
/// stored.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/store/connection.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// A score's position in the list, which is sorted by it.
struct ScoreKey {
  std::string trainee, exercise_id;  ///< the trainee's ref
  std::string name;                  ///< the trainee's name at that time, by which the list is sorted
  std::int64_t started_unix_ns = INT64_MIN;
  std::int64_t number = 0;    ///< of the session
  std::uint32_t version = 0;  ///< of the definitions
};

/// Scores of counting attempts, by trainee, exercise, attempt and version. Iterates over trainees and
/// exercises by the sums (attempt_sums.h) and reads the attempts of one pair at a time by key. Does not own
/// the connection. Thread: as its Connection; all calls within one view.
class ScoreList {
 public:
  /// After `after`; restricted to the exercises of `course_id` and members of `group_id`; empty: all.
  ScoreList(Connection& connection, ScoreKey after, std::string course_id, std::string group_id);

  /// The next score with its attempt, without the attempt's own score text; nothing at the end.
  Result<std::optional<pb::ScoreRow>> next();
  /// Position of the score that next() returned last; before that, `after`.
  [[nodiscard]] const ScoreKey& key() const { return key_; }

 private:
  struct Row {
    pb::ScoreRow row;
    std::int64_t number = 0;
  };
  /// A trainee's attempts in an exercise, and the last one read.
  struct Pair {
    std::string exercise_id;
    std::int64_t started_unix_ns = INT64_MIN, number = 0;
    std::uint32_t place = 0;
  };
  Status begin();
  Status exercisesFrom(const std::string& first);
  Result<std::string> traineeBehind(const std::string& name);
  Result<bool> nextPair();
  Status readAttempts();

  Connection& connection_;
  const std::string course_id_, group_id_;
  ScoreKey key_;
  bool begun_ = false;
  std::string name_;                    ///< of trainee_
  std::string trainee_;                 ///< whose exercises these are; empty: none yet
  std::vector<std::string> exercises_;  ///< the trainee's remaining exercises, next one last
  std::optional<Pair> pair_;            ///< nothing: finished
  std::vector<Row> rows_;               ///< read but not returned yet, next one last
};

}  // namespace needlelab
