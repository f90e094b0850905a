#include "client/station/run/lesson/curriculum.h"

#include <sodium.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <string_view>
#include <utility>

#include "client/net/spool/spool_json.h"
#include "client/station/run/io/station_key.h"
#include "common/base/bytes.h"
#include "common/base/files/files.h"
#include "common/base/text/strict_json.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

using CacheJson = nlohmann::json;
constexpr std::size_t kMaxCacheBytes = 16u << 20;
constexpr std::size_t kMaxStandings = 500;
constexpr int kMaxListPages = 200;  // bounds a list that never ends

std::string cachedText(const CacheJson& json, const char* key) {
  const auto at = json.is_object() ? json.find(key) : json.end();
  return at != json.end() && at->is_string() ? printable(at->get<std::string>()) : std::string();
}

std::int64_t cachedNumber(const CacheJson& json, const char* key) {
  const auto at = json.is_object() ? json.find(key) : json.end();
  return at != json.end() && at->is_number_integer() ? at->get<std::int64_t>() : 0;
}

bool cachedFlag(const CacheJson& json, const char* key) {
  return json.is_object() && json.value(key, CacheJson()) == true;
}

// returns an empty list for any other value
const CacheJson& cachedList(const CacheJson& json, const char* key) {
  static const CacheJson kNone = CacheJson::array();
  const auto at = json.is_object() ? json.find(key) : json.end();
  return at != json.end() && at->is_array() ? *at : kNone;
}

std::vector<std::string> cachedTexts(const CacheJson& json, const char* key) {
  std::vector<std::string> texts;
  for (const CacheJson& text : cachedList(json, key))
    if (text.is_string()) texts.push_back(printable(text.get<std::string>()));
  return texts;
}

std::vector<std::string> coursesOf(const std::vector<ServerExercise>& exercises) {
  std::vector<std::string> ids;
  for (const ServerExercise& exercise : exercises)
    if (std::find(ids.begin(), ids.end(), exercise.course_id) == ids.end()) ids.push_back(exercise.course_id);
  return ids;
}

// reads all pages of a course's results; empty `trainee`: everyone's names
template <typename TakeRow>
Status resultsBy(const AskServer& ask, const std::string& course, const std::string& trainee,
                 TakeRow&& take_row) {
  pb::Request request;
  request.mutable_get_results()->set_course_id(course);
  request.mutable_get_results()->set_trainee(trainee);
  for (int page = 0; page < kMaxListPages; ++page) {
    ASSIGN_OR_RETURN(const auto reply, ask(request));
    for (const pb::ResultRow& row : reply.results().rows()) take_row(row);
    if (reply.results().next_page().empty()) break;
    request.mutable_get_results()->set_page(reply.results().next_page());
  }
  return {};
}

StepStanding stepOf(const pb::ResultCell& cell) {
  StepStanding step;
  step.exercise_id = printable(cell.exercise_id());
  step.done = cell.done();
  step.attempts = cell.attempts();
  for (const std::string& id : cell.locked_by()) step.locked_by.push_back(printable(id));
  if (cell.has_attempts_left()) step.attempts_left = cell.attempts_left();
  step.due_unix_ns = cell.due_unix_ns();
  return step;
}

}  // namespace

bool canStart(const ServerExercise& exercise, const TraineeStanding* standing) {
  const auto holds = [](const std::vector<std::string>& ids, const std::string& id) {
    return std::find(ids.begin(), ids.end(), id) != ids.end();
  };
  return !exercise.assigned_only ||
         (standing != nullptr &&
          (holds(standing->courses, exercise.course_id) || holds(standing->exercises, exercise.exercise_id)));
}

void noteBegun(Curriculum& curriculum, const std::string& trainee, const std::string& exercise_id) {
  const auto known = curriculum.standings.find(trainee);
  if (known == curriculum.standings.end()) return;
  const bool exam =
      std::any_of(curriculum.exercises.begin(), curriculum.exercises.end(),
                  [&](const ServerExercise& one) { return one.exercise_id == exercise_id && one.exam; });
  for (StepStanding& step : known->second.steps) {
    if (exam) std::erase(step.locked_by, exercise_id);
    if (step.exercise_id != exercise_id) continue;
    ++step.attempts;
    if (step.attempts_left.value_or(0) > 0) --*step.attempts_left;
    step.done = step.done || exam;
  }
}

std::string shownName(const std::vector<KnownTrainee>& trainees, const std::string& name) {
  const auto own = std::find_if(trainees.begin(), trainees.end(),
                                [&](const KnownTrainee& trainee) { return trainee.name == name; });
  if (own == trainees.end() || own->full_name.empty()) return name;
  // another account's name may equal this person's full name
  const auto alike = std::count_if(trainees.begin(), trainees.end(), [&](const KnownTrainee& trainee) {
    return trainee.full_name == own->full_name || (trainee.name != name && trainee.name == own->full_name);
  });
  return alike > 1 ? own->full_name + " (" + name + ")" : own->full_name;
}

std::string accountOf(const std::vector<KnownTrainee>& trainees, const std::string& text) {
  const auto is = [&](const KnownTrainee& trainee) { return trainee.name == text; };
  if (std::any_of(trainees.begin(), trainees.end(), is)) return text;
  for (const KnownTrainee& trainee : trainees)
    if (shownName(trainees, trainee.name) == text) return trainee.name;
  return text;
}

std::string personOf(const std::vector<KnownTrainee>& trainees, const std::string& name) {
  for (const KnownTrainee& trainee : trainees)
    if (trainee.name == name) return trainee.person;
  return {};
}

Result<std::vector<ServerExercise>> exercisesBy(const AskServer& ask) {
  pb::Request request;
  request.mutable_list_curricula();
  ASSIGN_OR_RETURN(const auto curricula, ask(request));
  std::vector<ServerExercise> exercises;
  for (const pb::CurriculumSummary& summary : curricula.curricula().curricula()) {
    request.mutable_get_curriculum()->set_id(summary.id());
    ASSIGN_OR_RETURN(const auto reply, ask(request));
    const auto curriculum = readShallowJson<CacheJson>(reply.curriculum().json());
    const std::string name = printable(summary.name().empty() ? summary.id() : summary.name());
    const bool exam = cachedFlag(curriculum, "exam");
    const bool assigned_only = exam || cachedFlag(curriculum, "assigned_only");
    for (const auto& exercise : cachedList(curriculum, "exercises"))
      exercises.push_back({cachedText(exercise, "id"), cachedText(exercise, "name"),
                           cachedText(exercise, "profile_id"), cachedText(exercise, "description"),
                           printable(summary.id()), name, assigned_only, exam});
  }
  return exercises;
}

Result<std::vector<KnownTrainee>> traineesBy(const AskServer& ask,
                                             const std::vector<ServerExercise>& exercises) {
  std::map<std::string, KnownTrainee> by_name;
  for (const std::string& course : coursesOf(exercises))
    RETURN_IF_ERROR(resultsBy(ask, course, "", [&](const pb::ResultRow& row) {
      if (checkName("trainee", row.trainee()).ok())
        by_name[row.trainee()] = {row.trainee(), printable(row.full_name()), printable(row.person_ref())};
    }));
  std::vector<KnownTrainee> trainees;
  for (auto& [name, trainee] : by_name) trainees.push_back(std::move(trainee));
  return trainees;
}

Result<TraineeStanding> standingBy(const AskServer& ask, const std::vector<ServerExercise>& exercises,
                                   const std::string& trainee, std::int64_t now_unix_ns) {
  TraineeStanding standing;
  standing.as_of_unix_ns = now_unix_ns;
  pb::Request request;
  request.mutable_list_assignments()->set_trainee(trainee);
  std::set<std::string> courses, single;
  for (int page = 0; page < kMaxListPages; ++page) {
    ASSIGN_OR_RETURN(const auto reply, ask(request));
    for (const pb::Assignment& assignment : reply.assignments().assignments()) {
      if (!assignment.course_id().empty()) courses.insert(printable(assignment.course_id()));
      if (!assignment.exercise_id().empty()) single.insert(printable(assignment.exercise_id()));
    }
    if (reply.assignments().next_page().empty()) break;
    request.mutable_list_assignments()->set_page(reply.assignments().next_page());
  }
  standing.courses.assign(courses.begin(), courses.end());
  standing.exercises.assign(single.begin(), single.end());
  for (const std::string& course : coursesOf(exercises))
    RETURN_IF_ERROR(resultsBy(ask, course, trainee, [&](const pb::ResultRow& row) {
      if (row.trainee() != trainee) return;
      for (const pb::ResultCell& cell : row.cells()) standing.steps.push_back(stepOf(cell));
    }));
  return standing;
}

Status updateCurriculum(Curriculum& curriculum, const AskServer& ask, const std::string& trainee,
                        std::int64_t now_unix_ns) {
  Curriculum updated = curriculum;
  ASSIGN_OR_RETURN(updated.exercises, exercisesBy(ask));
  ASSIGN_OR_RETURN(updated.trainees, traineesBy(ask, updated.exercises));
  std::erase_if(updated.standings, [&](const auto& entry) {
    return std::none_of(updated.trainees.begin(), updated.trainees.end(),
                        [&](const KnownTrainee& known) { return known.name == entry.first; });
  });
  if (!trainee.empty()) {
    ASSIGN_OR_RETURN(updated.standings[trainee], standingBy(ask, updated.exercises, trainee, now_unix_ns));
  }
  curriculum = std::move(updated);
  return {};
}

// --- the cache

namespace {

constexpr std::string_view kKeyOf = "needlelab curriculum.cache";

// returns null if file or key is missing, or the file is damaged or made with another key
CacheJson readCache(const std::filesystem::path& path, const std::string& key) {
  const auto file = readWholeFile(path, kMaxCacheBytes);
  if (key.empty() || !file.ok() || file->size() < crypto_secretbox_NONCEBYTES + crypto_secretbox_MACBYTES)
    return {};
  const ByteView bytes = viewOf(*file);
  const ByteView box = bytes.subspan(crypto_secretbox_NONCEBYTES);
  std::string text(box.size() - crypto_secretbox_MACBYTES, '\0');
  if (crypto_secretbox_open_easy(reinterpret_cast<unsigned char*>(text.data()), box.data(), box.size(),
                                 bytes.data(), viewOf(key).data()) != 0)
    return {};
  return readShallowJson<CacheJson>(text);
}

std::set<std::string> traineesWithCode(const CacheJson& json) {
  const std::vector<std::string> names = cachedTexts(json, "asks_code");
  return {names.begin(), names.end()};
}

}  // namespace

CurriculumCache::CurriculumCache(const std::filesystem::path& spool, const std::filesystem::path& key_file)
    : file_(spool / "lessons" / "curriculum.cache") {
  if (key_file.empty() || sodium_init() < 0) return;
  auto text = readWholeFile(key_file, 4096);
  if (!text.ok()) return;
  const WipeAtEnd wiped_text(*text);
  auto station = parseStationKey(*text, key_file.string());
  if (!station.ok()) return;
  const WipeAtEnd wiped_key(station->key);
  key_.resize(crypto_secretbox_KEYBYTES);
  crypto_generichash(reinterpret_cast<unsigned char*>(key_.data()), key_.size(), viewOf(kKeyOf).data(),
                     kKeyOf.size(), viewOf(station->key).data(), station->key.size());
}

Status CurriculumCache::keep(const Curriculum& curriculum) const {
  std::set<std::string> asks_code = traineesWithCode(readCache(file_, key_));
  // an empty list means that the server gave none
  if (!curriculum.trainees.empty())
    std::erase_if(asks_code, [&](const std::string& name) {
      return std::none_of(curriculum.trainees.begin(), curriculum.trainees.end(),
                          [&](const KnownTrainee& known) { return known.name == name; });
    });
  return write(curriculum, asks_code);
}

Status CurriculumCache::keepAsksCode(const std::string& trainee, bool asks) const {
  std::set<std::string> asks_code = traineesWithCode(readCache(file_, key_));
  const bool changed = asks ? asks_code.insert(trainee).second : asks_code.erase(trainee) > 0;
  return changed ? write(find(), asks_code) : Status();
}

Status CurriculumCache::keepBegun(const std::string& trainee, const std::string& exercise_id) const {
  Curriculum curriculum = find();
  const auto known = curriculum.standings.find(trainee);
  if (known == curriculum.standings.end()) return {};
  const TraineeStanding before = known->second;
  noteBegun(curriculum, trainee, exercise_id);
  return known->second == before ? Status() : write(curriculum, allTraineesWithCode());
}

bool CurriculumCache::asksCode(const std::string& trainee) const {
  return allTraineesWithCode().contains(trainee);
}

std::set<std::string> CurriculumCache::allTraineesWithCode() const {
  return traineesWithCode(readCache(file_, key_));
}

Status CurriculumCache::write(const Curriculum& curriculum, const std::set<std::string>& asks_code) const {
  if (key_.empty()) return {};
  CacheJson json = {{"exercises", CacheJson::array()},
                    {"trainees", CacheJson::array()},
                    {"standings", CacheJson::array()},
                    {"asks_code", asks_code}};
  for (const ServerExercise& exercise : curriculum.exercises)
    json["exercises"].push_back({{"id", exercise.exercise_id},
                                 {"name", exercise.name},
                                 {"profile_id", exercise.profile_id},
                                 {"description", exercise.description},
                                 {"course_id", exercise.course_id},
                                 {"course", exercise.course},
                                 {"assigned_only", exercise.assigned_only},
                                 {"exam", exercise.exam}});
  for (const KnownTrainee& trainee : curriculum.trainees)
    json["trainees"].push_back(
        {{"name", trainee.name}, {"full_name", trainee.full_name}, {"person", trainee.person}});
  std::vector<std::pair<std::int64_t, std::string>> newest;
  for (const auto& [name, standing] : curriculum.standings)
    newest.emplace_back(-standing.as_of_unix_ns, name);
  std::sort(newest.begin(), newest.end());
  if (newest.size() > kMaxStandings) newest.resize(kMaxStandings);
  for (const auto& [age, name] : newest) {
    const TraineeStanding& standing = curriculum.standings.at(name);
    CacheJson steps = CacheJson::array();
    for (const StepStanding& step : standing.steps)
      steps.push_back({{"id", step.exercise_id},
                       {"done", step.done},
                       {"attempts", step.attempts},
                       {"locked_by", step.locked_by},
                       {"attempts_left", step.attempts_left ? CacheJson(*step.attempts_left) : CacheJson()},
                       {"due_unix_ns", step.due_unix_ns}});
    json["standings"].push_back({{"trainee", name},
                                 {"as_of_unix_ns", standing.as_of_unix_ns},
                                 {"courses", standing.courses},
                                 {"exercises", standing.exercises},
                                 {"steps", std::move(steps)}});
  }
  const std::string text = json.dump(-1, ' ', false, CacheJson::error_handler_t::replace);
  std::string file(crypto_secretbox_NONCEBYTES + crypto_secretbox_MACBYTES + text.size(), '\0');
  auto* const bytes = reinterpret_cast<unsigned char*>(file.data());
  randombytes_buf(bytes, crypto_secretbox_NONCEBYTES);
  crypto_secretbox_easy(bytes + crypto_secretbox_NONCEBYTES, viewOf(text).data(), text.size(), bytes,
                        viewOf(key_).data());
  return writeSpoolText(file_, file);
}

Curriculum CurriculumCache::find() const {
  Curriculum curriculum;
  const CacheJson json = readCache(file_, key_);
  for (const CacheJson& exercise : cachedList(json, "exercises"))
    curriculum.exercises.push_back({cachedText(exercise, "id"), cachedText(exercise, "name"),
                                    cachedText(exercise, "profile_id"), cachedText(exercise, "description"),
                                    cachedText(exercise, "course_id"), cachedText(exercise, "course"),
                                    cachedFlag(exercise, "assigned_only"), cachedFlag(exercise, "exam")});
  for (const CacheJson& trainee : cachedList(json, "trainees"))
    curriculum.trainees.push_back(
        {cachedText(trainee, "name"), cachedText(trainee, "full_name"), cachedText(trainee, "person")});
  for (const CacheJson& entry : cachedList(json, "standings")) {
    TraineeStanding& standing = curriculum.standings[cachedText(entry, "trainee")];
    standing.as_of_unix_ns = cachedNumber(entry, "as_of_unix_ns");
    standing.courses = cachedTexts(entry, "courses");
    standing.exercises = cachedTexts(entry, "exercises");
    for (const CacheJson& cached : cachedList(entry, "steps")) {
      StepStanding step;
      step.exercise_id = cachedText(cached, "id");
      step.done = cachedFlag(cached, "done");
      step.attempts = static_cast<std::uint32_t>(cachedNumber(cached, "attempts"));
      step.locked_by = cachedTexts(cached, "locked_by");
      if (cached.is_object() && cached.value("attempts_left", CacheJson()).is_number_integer())
        step.attempts_left = static_cast<std::uint32_t>(cachedNumber(cached, "attempts_left"));
      step.due_unix_ns = cachedNumber(cached, "due_unix_ns");
      standing.steps.push_back(std::move(step));
    }
  }
  return curriculum;
}

}  // namespace needlelab
