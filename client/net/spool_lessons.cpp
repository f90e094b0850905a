#include "net/spool_lessons.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>

#include "base/atomic_file.h"

namespace needlelab {

Result<std::filesystem::path> LessonCache::fileOf(const std::string& exercise_id) const {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  };
  // an id becomes a file name: nothing may lead out of the folder
  if (exercise_id.empty() || exercise_id.size() > 64 || exercise_id.front() == '.' ||
      !std::all_of(exercise_id.begin(), exercise_id.end(), allowed))
    return Error{ErrorCode::kInvalidInput,
                 "exercise '" + exercise_id.substr(0, 64) +
                     "' is no exercise's id: 1 to 64 letters, digits, '-', '_', '.', the "
                     "first not a '.'"};
  return folder_ / (exercise_id + ".json");
}

Status LessonCache::keep(const std::string& exercise_id, const pb::Lesson& lesson) const {
  auto file = fileOf(exercise_id);
  if (!file.ok()) return file.error();
  std::string json;
  const auto written = google::protobuf::util::MessageToJsonString(lesson, &json);
  if (!written.ok())
    return Error{ErrorCode::kFailed, "the lesson cannot be written as JSON: " + written.ToString()};
  if (auto status = writeFileAtomically(*file, viewOf(json), 0600); !status.ok())
    return Error{ErrorCode::kUnavailable, status.error().message};
  return {};
}

Result<pb::Lesson> LessonCache::find(const std::string& exercise_id) const {
  auto file = fileOf(exercise_id);
  if (!file.ok()) return file.error();
  std::error_code ignored;
  if (!std::filesystem::exists(*file, ignored))
    return Error{ErrorCode::kNotFound, "exercise '" + exercise_id + "' was never fetched from the server: " +
                                           file->string() + " does not exist"};
  auto text = readWholeFile(*file, 8u << 20);
  if (!text.ok()) return text.error();
  pb::Lesson lesson;
  if (const auto parsed = google::protobuf::util::JsonStringToMessage(*text, &lesson); !parsed.ok())
    return Error{ErrorCode::kCorrupt,
                 file->string() + ": " + parsed.ToString() + "; delete it and connect to the server"};
  return lesson;
}

}  // namespace needlelab
