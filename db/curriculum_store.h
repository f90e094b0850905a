/// Curricula by id and revision, the exercises of their newest revisions, and who shall do which exercise.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "db/connection.h"

namespace needlelab {

struct StoredExercise {
  std::string id;
  std::string curriculum_id;
  std::string name;
  std::string profile_id;
  std::string json;  ///< canonical
};

struct StoredCurriculum {
  std::string id;
  std::uint32_t revision = 0;
  std::string name;
  std::string json;  ///< canonical; empty in lists
  std::string author;
  std::int64_t created_unix_ns = 0;
  std::vector<StoredExercise> exercises;  ///< in order; `curriculum_id` is filled by the store
};

struct StoredAssignment {
  std::string trainee;
  std::string exercise_id;
  std::string by;
  std::int64_t created_unix_ns = 0;
};

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class CurriculumStore {
 public:
  explicit CurriculumStore(Connection& connection) : connection_(connection) {}

  /// Stores the next revision and makes its exercises the current ones, or gives the newest revision when its
  /// text is the same. Errors: kInvalidInput (sizes), kNotFound (an exercise names a profile that is not
  /// there), kAlreadyExists (an exercise of this id belongs to another curriculum).
  Result<std::uint32_t> put(const StoredCurriculum& curriculum);
  /// The newest revision, exercises included. kNotFound.
  Result<StoredCurriculum> get(std::string_view id);
  /// The newest revision of each, by id, with their exercises, without their texts.
  Result<std::vector<StoredCurriculum>> list();

  /// kNotFound.
  Result<StoredExercise> exercise(std::string_view id);

  /// Errors: kNotFound (person or exercise), kInvalidInput (the person is no trainee). Repeating it renews
  /// it.
  Status assign(const StoredAssignment& assignment);
  /// Newest first; empty `trainee`: everybody's.
  Result<std::vector<StoredAssignment>> assignments(std::string_view trainee);

 private:
  Result<std::vector<StoredExercise>> exercisesOf(std::string_view curriculum_id);
  Connection& connection_;
};

}  // namespace needlelab
