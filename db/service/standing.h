/// A trainee's standing in an exercise: locks, attempts left, due date. Private to this folder.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "db/assignments.h"
#include "db/connection.h"
#include "db/documents.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Passed; or, for an exercise without requirements, tried in an attempt that counts.
bool isDone(const AttemptStanding& attempts, const pb::Exercise& exercise);

struct ExerciseStanding {
  AttemptStanding attempts;
  bool done = false;
  std::vector<std::string> locked_by;          ///< prerequisite exercises not yet passed
  std::optional<std::uint32_t> attempts_left;  ///< nothing: unlimited
  std::int64_t due_unix_ns = 0;                ///< 0: never
};

/// Parses an exercise's text. kCorrupt: this program cannot read the stored text.
Result<pb::Exercise> exerciseOf(const StoredExercise& stored);

/// `trainee` may be any name, known or not.
Result<ExerciseStanding> standingOf(Connection& connection, const std::string& trainee,
                                    const StoredExercise& stored, const pb::Exercise& exercise);

/// Nothing when the trainee may begin; otherwise the reason, as a text for the trainee with the exercises'
/// names.
Result<std::optional<std::string>> whyNot(Connection& connection, const pb::Exercise& exercise,
                                          const ExerciseStanding& standing);

}  // namespace needlelab
