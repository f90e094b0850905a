#include "client/net/spool/lesson_cache.h"

#include <fmt/core.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "client/net/spool/spool_json.h"
#include "common/base/files/files.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"

namespace needlelab {
namespace {

using Json = nlohmann::json;
constexpr std::size_t kMaxFileBytes = 8u << 20;
constexpr const char* kExtension = ".json";

// each part ends with a byte that no part contains, so that no text can move from one part to the next
std::string hashOf(const std::string& exercise_id, const pb::Lesson& lesson) {
  SessionHash hash;
  for (const std::string& part : {exercise_id, lesson.exercise_json(), lesson.profile_json(),
                                  std::to_string(lesson.profile_revision())}) {
    hash.update(viewOf(part));
    hash.update(viewOf(std::string_view("\0", 1)));
  }
  // left out for a course without rules, whose hash stays as it was
  if (lesson.assigned_only())
    hash.update(
        viewOf(fmt::format("{}{}{}", lesson.assigned_only(), lesson.exam(), lesson.results_from_unix_ns())));
  return hexOf(hash.digest());
}

// the JSON value may be of any kind
std::string textAt(const Json& json, const char* key) {
  const auto at = json.is_object() ? json.find(key) : json.end();
  return at != json.end() && at->is_string() ? at->get<std::string>() : std::string();
}

Error brokenLesson(const std::filesystem::path& path, const std::string& why) {
  return Error{ErrorCode::kCorrupt,
               path.string() + ": " + why + "; delete it and connect to the server once to fetch it again"};
}

struct CacheFile {
  pb::Lesson lesson;
  std::int64_t fetched_unix_ns = 0;
};

Result<CacheFile> readCacheFile(const std::filesystem::path& path, const std::string& exercise_id) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return brokenLesson(path, "is not a file");
  auto text = readWholeFile(path, kMaxFileBytes);
  if (!text.ok()) return brokenLesson(path, "cannot be read (" + text.error().message + ")");
  const Json json = parsedShallow(*text);
  if (!json.is_object())
    return brokenLesson(path, "is not a JSON object: it was damaged, or somebody else's");

  CacheFile file;
  const bool wrapped = json.contains("lesson");
  const auto parsed =
      google::protobuf::util::JsonStringToMessage(wrapped ? json["lesson"].dump() : *text, &file.lesson);
  if (!parsed.ok()) return brokenLesson(path, "holds no lesson");
  if (const auto at = json.find("fetched_unix_ns"); at != json.end() && at->is_number_integer())
    file.fetched_unix_ns = at->get<std::int64_t>();
  if (wrapped && textAt(json, "hash") != hashOf(exercise_id, file.lesson))
    return brokenLesson(
        path, "was changed since it came from the server (its hash does not agree): it is not used");
  const Json exercise = parsedShallow(file.lesson.exercise_json());
  if (exercise.is_null())
    return brokenLesson(path, "its exercise is nested more deeply than one from a server");
  if (const std::string id = textAt(exercise, "id"); !id.empty() && id != exercise_id)
    return brokenLesson(path, "is the lesson of another exercise, '" + printable(id) + "'");
  return file;
}

}  // namespace

Result<std::filesystem::path> LessonCache::fileOf(const std::string& exercise_id) const {
  const auto allowed = [](char c) { return isLetterOrDigit(c) || c == '-' || c == '_' || c == '.'; };
  // an id becomes a file name and must not lead out of the folder
  if (exercise_id.empty() || exercise_id.size() > 64 || exercise_id.front() == '.' ||
      !std::all_of(exercise_id.begin(), exercise_id.end(), allowed))
    return Error{
        ErrorCode::kInvalidInput,
        "exercise '" + printable(exercise_id.substr(0, 64)) +
            "' is not an exercise's id: 1 to 64 letters, digits, '-', '_', '.', the first not a '.'"};
  return folder_ / (exercise_id + kExtension);
}

Status LessonCache::keep(const std::string& exercise_id, const pb::Lesson& lesson) const {
  ASSIGN_OR_RETURN(auto file, fileOf(exercise_id));
  std::string text;
  const auto written = google::protobuf::util::MessageToJsonString(lesson, &text);
  if (!written.ok())
    return Error{ErrorCode::kFailed, "the lesson cannot be written as JSON: " + written.ToString()};
  const nlohmann::ordered_json json = {{"exercise_id", exercise_id},
                                       {"fetched_unix_ns", wallNowNs()},
                                       {"hash", hashOf(exercise_id, lesson)},
                                       {"lesson", nlohmann::ordered_json::parse(text)}};
  return writeSpoolText(file, json.dump(1) + "\n");
}

Result<pb::Lesson> LessonCache::find(const std::string& exercise_id) const {
  ASSIGN_OR_RETURN(auto path, fileOf(exercise_id));
  std::error_code ignored;
  if (!std::filesystem::exists(std::filesystem::symlink_status(path, ignored)))
    return Error{ErrorCode::kNotFound, "exercise '" + exercise_id + "' was never fetched from the server: " +
                                           path.string() + " does not exist"};
  ASSIGN_OR_RETURN(auto file, readCacheFile(path, exercise_id));
  return std::move(file.lesson);
}

std::vector<CachedLesson> LessonCache::list() const {
  std::vector<CachedLesson> lessons;
  std::error_code error;
  for (auto at = std::filesystem::directory_iterator(folder_, error);
       !error && at != std::filesystem::end(at); at.increment(error)) {
    CachedLesson lesson;
    lesson.exercise_id = at->path().stem().string();
    // skip files being written, and foreign files
    if (at->path().extension() != kExtension || !fileOf(lesson.exercise_id).ok()) continue;
    auto file = readCacheFile(at->path(), lesson.exercise_id);
    if (file.ok()) {
      const Json exercise = parsedShallow(file->lesson.exercise_json());
      lesson.name = printable(textAt(exercise, "name"));
      lesson.profile_id = printable(textAt(exercise, "profile_id"));
      lesson.profile_revision = file->lesson.profile_revision();
      lesson.fetched_unix_ns = file->fetched_unix_ns;
      lesson.assigned_only = file->lesson.assigned_only();
      lesson.exam = file->lesson.exam();
    } else {
      lesson.trouble = file.error().message;
    }
    lessons.push_back(std::move(lesson));
  }
  std::sort(lessons.begin(), lessons.end(),
            [](const auto& a, const auto& b) { return a.exercise_id < b.exercise_id; });
  return lessons;
}

}  // namespace needlelab
