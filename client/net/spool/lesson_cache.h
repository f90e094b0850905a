/// Caches lessons beside the spool, so that a station works without its server.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// A lesson in the cache, for a list.
struct CachedLesson {
  std::string exercise_id;
  std::string name;  ///< the exercise's; empty when the file cannot be read
  std::string profile_id;
  std::uint32_t profile_revision = 0;
  std::int64_t fetched_unix_ns = 0;  ///< 0: unknown
  std::string trouble;               ///< why the lesson cannot be used; empty if it can
  bool assigned_only = false;        ///< from a course only for those to whom it is assigned
  bool exam = false;                 ///< from an exam
};

/// Files SPOOL/lessons/EXERCISE.json: {"exercise_id", "fetched_unix_ns", "hash", "lesson": pb::Lesson}. The
/// hash (BLAKE2b-256 over exercise, profile, revision and the course's rules) detects a damaged profile;
/// otherwise the trainee would feel a flipped digit in a stiffness. Older files without a hash are read, too.
/// Thread: one.
class LessonCache {
 public:
  explicit LessonCache(const std::filesystem::path& spool) : folder_(spool / "lessons") {}

  /// Errors: kInvalidInput for an id that is not a file name (letters, digits, '-', '_', '.'), kUnavailable
  /// (disk).
  Status keep(const std::string& exercise_id, const pb::Lesson& lesson) const;
  /// Errors: kNotFound when the lesson was never fetched; kCorrupt when the file is not a lesson, is damaged
  /// or belongs to another exercise, with the file's name and advice; kInvalidInput for the id.
  [[nodiscard]] Result<pb::Lesson> find(const std::string& exercise_id) const;
  /// Lists the cached lessons by id; `trouble` marks the unusable ones.
  [[nodiscard]] std::vector<CachedLesson> list() const;

 private:
  [[nodiscard]] Result<std::filesystem::path> fileOf(const std::string& exercise_id) const;
  std::filesystem::path folder_;
};

}  // namespace needlelab
