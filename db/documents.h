/// Documents with revisions: patient profiles, curricula (courses) and their exercises. A revision is never
/// overwritten, because sessions refer to it. An edit names its base revision.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// A document's newest revision, with its author and time.
struct NewestRevision {
  std::uint32_t revision = 0;  ///< 0: no revision exists
  std::string by;
  std::int64_t unix_ns = 0;
};

/// kConflict, with `current_revision`, unless `base` is the newest revision. Without `base` any revision is
/// accepted. `what`: "profile 'knee'".
Status checkBase(const std::string& what, std::optional<std::uint32_t> base, const NewestRevision& newest);

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

  /// Stores `profile.json` (canonical; the caller has validated it) as the next revision. Returns the newest
  /// revision when its text is the same. Ignores `revision` of the argument. kInvalidInput: id, name or size.
  /// `base`: the revision that the text was made from (0: none), else kConflict; absent: any.
  Result<std::uint32_t> put(const StoredProfile& profile, std::optional<std::uint32_t> base = {});
  /// `revision` 0: the newest. kNotFound names the id, and the revision when one was given.
  Result<StoredProfile> get(std::string_view id, std::uint32_t revision);
  /// The newest revision of each profile, by id, without the JSON texts.
  Result<std::vector<StoredProfile>> list();
  /// All revisions of a profile, newest first, without the JSON texts. kNotFound.
  Result<std::vector<StoredProfile>> revisions(std::string_view id);

 private:
  Connection& connection_;
};

/// What an exercise's course says of who may begin it, and how often.
struct CourseRules {
  bool assigned_only = false;                  ///< true of an exam, too
  std::optional<std::uint32_t> exam_attempts;  ///< of an exam: how many count; nothing: it is no exam
  std::int64_t results_from_unix_ns = 0;       ///< of an exam: trainees see results from then on; 0: at once
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

  /// Stores the next revision and makes its exercises current; where their rules change, attempts are counted
  /// again (AttemptStore::countExam). Returns the newest revision when its text is
  /// the same. Errors: kInvalidInput (sizes), kNotFound (an exercise names an unknown profile),
  /// kAlreadyExists (another curriculum has an exercise with this id). `base`: the revision that the text was
  /// made from (0: none), else kConflict; absent: any.
  Result<std::uint32_t> put(const StoredCurriculum& curriculum, std::optional<std::uint32_t> base = {});
  /// `revision` 0: the newest. `exercises` always belong to the newest revision. kNotFound.
  Result<StoredCurriculum> get(std::string_view id, std::uint32_t revision = 0);
  /// All revisions of a curriculum, newest first, without texts and exercises. kNotFound.
  Result<std::vector<StoredCurriculum>> revisions(std::string_view id);
  /// The newest revision of each curriculum, by id, with exercises, without the JSON texts.
  Result<std::vector<StoredCurriculum>> list();

  /// kNotFound.
  Result<StoredExercise> exercise(std::string_view id);
  /// Those of exercises that are not there (any more) are those of a course that says nothing.
  Result<CourseRules> rulesOf(std::string_view exercise_id);

 private:
  /// Makes `curriculum.exercises` current. Errors as put().
  Status setExercises(const StoredCurriculum& curriculum);
  Result<std::vector<StoredExercise>> exercisesOf(std::string_view curriculum_id);
  Connection& connection_;
};

}  // namespace needlelab
