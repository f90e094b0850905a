/// Documents under revisions: profiles of patients, curricula (courses) with their exercises. A revision is
/// never overwritten: sessions refer to it. An edit names the revision that it was made from.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

/// The newest revision of a document, by whom and when it was made.
struct NewestRevision {
  std::uint32_t revision = 0;  ///< 0: none yet
  std::string by;
  std::int64_t unix_ns = 0;
};

/// "2026-11-20 17:40:11 UTC"
std::string secondText(std::int64_t unix_ns);

/// kConflict, with `current_revision`, unless `base` is the newest one. Without `base` every
/// revision will do. `what`: "profile 'knee'".
Status checkBase(const std::string& what, std::optional<std::uint32_t> base, const NewestRevision& newest);

struct StoredProfile {
  std::string id;
  std::uint32_t revision = 0;
  std::string name;
  std::string json;  ///< canonical; empty in lists
  std::string author;
  std::int64_t created_unix_ns = 0;
};

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class ProfileStore {
 public:
  explicit ProfileStore(Connection& connection) : connection_(connection) {}

  /// Stores `profile.json` (canonical; the caller has validated it) as the next revision, or gives the newest
  /// revision when its text is the same. `revision` of the argument is not read. kInvalidInput: id, name or
  /// size.
  /// `base`: the revision that the text was made from (0: none), else kConflict; absent: any.
  Result<std::uint32_t> put(const StoredProfile& profile, std::optional<std::uint32_t> base = {});
  /// `revision` 0: the newest. kNotFound names id, and revision where one was given.
  Result<StoredProfile> get(std::string_view id, std::uint32_t revision);
  /// The newest revision of each, by id, without their texts.
  Result<std::vector<StoredProfile>> list();
  /// All revisions of one, newest first, without their texts. kNotFound.
  Result<std::vector<StoredProfile>> revisions(std::string_view id);

 private:
  Connection& connection_;
};

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

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class CurriculumStore {
 public:
  explicit CurriculumStore(Connection& connection) : connection_(connection) {}

  /// Stores the next revision and makes its exercises the current ones, or gives the newest revision when its
  /// text is the same. Errors: kInvalidInput (sizes), kNotFound (an exercise names an unknown
  /// profile), kAlreadyExists (an exercise of this id belongs to another curriculum).
  /// `base`: the revision that the text was made from (0: none), else kConflict; absent: any.
  Result<std::uint32_t> put(const StoredCurriculum& curriculum, std::optional<std::uint32_t> base = {});
  /// The part of put() that makes `curriculum.exercises` the current ones. Errors as there.
  Status setExercises(const StoredCurriculum& curriculum);
  /// `revision` 0: the newest. `exercises` are those of the newest in any case. kNotFound.
  Result<StoredCurriculum> get(std::string_view id, std::uint32_t revision = 0);
  /// All revisions of one, newest first, without texts and exercises. kNotFound.
  Result<std::vector<StoredCurriculum>> revisions(std::string_view id);
  /// The newest revision of each, by id, with their exercises, without their texts.
  Result<std::vector<StoredCurriculum>> list();

  /// kNotFound.
  Result<StoredExercise> exercise(std::string_view id);

 private:
  Result<std::vector<StoredExercise>> exercisesOf(std::string_view curriculum_id);
  Connection& connection_;
};

}  // namespace needlelab
