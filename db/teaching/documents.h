/// Documents with revisions: patient profiles, curricula (courses) and their exercises. A revision is never
/// overwritten, because sessions refer to it. An edit names its base revision.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

struct StoredProfile {
  std::string id;
  std::uint32_t revision = 0;
  std::string name;
  std::string json;  ///< canonical; empty in lists
  std::string author;
  std::int64_t created_unix_ns = 0;
};

/// Does not own the connection. Thread: as its Connection; changes need the writer's.
class ProfileStore {
 public:
  explicit ProfileStore(Connection& connection) : connection_(connection) {}

  /// Stores `profile.json` (canonical; validated by the caller) as the next revision; returns the newest
  /// revision if its text is the same. Ignores `profile.revision`. `base`: the revision that the text is
  /// based on (0: none), else kConflict; absent: any. kInvalidInput: id, name or size.
  Result<std::uint32_t> put(const StoredProfile& profile, std::optional<std::uint32_t> base = {});
  /// `revision` 0: the newest. kNotFound names the id, and the revision if one was given.
  Result<StoredProfile> get(std::string_view id, std::uint32_t revision);
  /// The newest revision of each profile, by id, without the JSON texts.
  Result<std::vector<StoredProfile>> list();
  /// All revisions of a profile, newest first, without the JSON texts. kNotFound.
  Result<std::vector<StoredProfile>> revisions(std::string_view id);

 private:
  Connection& connection_;
};

/// A course's rules on who may begin its exercises, and how often.
struct CourseRules {
  bool assigned_only = false;                  ///< also true for exams
  std::optional<std::uint32_t> exam_attempts;  ///< exams: how many attempts count; nothing: not an exam
  std::int64_t results_from_unix_ns = 0;       ///< exams: when trainees may see results; 0: at once
  friend bool operator==(const CourseRules&, const CourseRules&) = default;
};

struct StoredExercise {
  std::string id;
  std::string curriculum_id;
  std::string name;
  std::string profile_id;
  std::string json;        ///< canonical
  CourseRules rules = {};  ///< of its course
};

struct StoredCurriculum {
  std::string id;
  std::uint32_t revision = 0;
  std::string name;
  std::string json;  ///< canonical; empty in lists
  std::string author;
  std::int64_t created_unix_ns = 0;
  std::vector<StoredExercise> exercises;  ///< in order; the store fills in `curriculum_id`
};

/// Does not own the connection. Thread: as its Connection; changes need the writer's.
class CurriculumStore {
 public:
  explicit CurriculumStore(Connection& connection) : connection_(connection) {}

  /// Stores the next revision and makes its exercises current; if their rules change, attempts are recounted
  /// (AttemptStore::countExam). Returns the newest revision if its text is the same. `base`: the revision
  /// that the text is based on (0: none), else kConflict; absent: any. Errors: kInvalidInput (sizes),
  /// kNotFound (an exercise names an unknown profile), kAlreadyExists (another curriculum has an exercise
  /// with this id).
  Result<std::uint32_t> put(const StoredCurriculum& curriculum, std::optional<std::uint32_t> base = {});
  /// `revision` 0: the newest. `exercises` always belong to the newest revision. kNotFound.
  Result<StoredCurriculum> get(std::string_view id, std::uint32_t revision = 0);
  /// All revisions of a curriculum, newest first, without texts and exercises. kNotFound.
  Result<std::vector<StoredCurriculum>> revisions(std::string_view id);
  /// The newest revision of each curriculum, by id, with exercises, without the JSON texts.
  Result<std::vector<StoredCurriculum>> list();

  /// kNotFound.
  Result<StoredExercise> exercise(std::string_view id);
  /// Missing (or removed) exercises have the default rules.
  Result<CourseRules> rulesOf(std::string_view exercise_id);

 private:
  /// Makes `curriculum.exercises` current. Errors: as put().
  Status setExercises(const StoredCurriculum& curriculum);
  Result<std::vector<StoredExercise>> exercisesOf(std::string_view curriculum_id);
  Connection& connection_;
};

}  // namespace needlelab
