/// Lessons kept beside the spool, so that a station works when the server is away (DESIGN §7).
#pragma once

#include <filesystem>
#include <string>

#include "base/result.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// Files SPOOL/lessons/EXERCISE.json, each a pb::Lesson. Thread: one.
class LessonCache {
 public:
  explicit LessonCache(const std::filesystem::path& spool) : folder_(spool / "lessons") {}

  /// Errors: kInvalidInput for an id that is no file name (letters, digits, '-', '_', '.'), kUnavailable
  /// (disk).
  Status keep(const std::string& exercise_id, const pb::Lesson& lesson) const;
  /// Errors: kNotFound when it was never fetched, kCorrupt, kInvalidInput for the id.
  [[nodiscard]] Result<pb::Lesson> find(const std::string& exercise_id) const;

 private:
  [[nodiscard]] Result<std::filesystem::path> fileOf(const std::string& exercise_id) const;
  std::filesystem::path folder_;
};

}  // namespace needlelab
