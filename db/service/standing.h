/// How a trainee stands with an exercise: what is locked, what is left, by when. Private to this folder.
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

/// Passed, or, when the exercise asks for nothing, tried in an attempt that counts.
bool isDone(const AttemptStanding& attempts, const pb::Exercise& exercise);

struct ExerciseStanding {
  AttemptStanding attempts;
  bool done = false;
  std::vector<std::string> locked_by;          ///< exercises that must be passed first, and are not
  std::optional<std::uint32_t> attempts_left;  ///< nothing: as many as one likes
  std::int64_t due_unix_ns = 0;                ///< 0: never
};

/// An exercise's text as a message. kCorrupt: a stored text that this program cannot read.
Result<pb::Exercise> exerciseOf(const StoredExercise& stored);

/// `trainee` may be anybody, known or not.
Result<ExerciseStanding> standingOf(Connection& connection, const std::string& trainee,
                                    const StoredExercise& stored, const pb::Exercise& exercise);

/// Nothing when the trainee may begin; else why not, for the trainee: with the names of the exercises.
Result<std::optional<std::string>> whyNot(Connection& connection, const pb::Exercise& exercise,
                                          const ExerciseStanding& standing);

}  // namespace needlelab
