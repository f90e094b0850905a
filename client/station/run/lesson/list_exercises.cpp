#include "client/station/run/lesson/list_exercises.h"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "client/net/link/blocking_client.h"
#include "client/net/spool/spool_outlook.h"
#include "client/station/run/io/station_key.h"
#include "client/station/run/io/terminal.h"
#include "client/station/run/lesson/built_in.h"
#include "common/base/program.h"
#include "common/base/text/text.h"
#include "common/base/time/clock.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

using Json = nlohmann::ordered_json;

// adds the ladder's columns for an exercise
void addStep(Json& row, const Ladder& ladder) {
  for (const LadderSection& section : ladder.sections)
    for (const LadderStep& step : section.steps) {
      if (step.exercise_id != row["exercise_id"]) continue;
      row["section"] = section.heading;
      row["step"] = step.number > 0 ? Json(step.number) : Json(nullptr);
      row["state"] = stepStateName(step.state);
      row["locked_by"] = step.locked_by.empty() ? Json(nullptr) : Json(step.locked_by);
      row["attempts_left"] = step.attempts_left ? Json(*step.attempts_left) : Json(nullptr);
      row["due_unix_ns"] = step.due_unix_ns != 0 ? Json(step.due_unix_ns) : Json(nullptr);
      row["as_of_unix_ns"] = ladder.as_of_unix_ns != 0 ? Json(ladder.as_of_unix_ns) : Json(nullptr);
    }
}

}  // namespace

Status askServerForCurriculum(Curriculum& curriculum, const StationOptions& options) {
  ASSIGN_OR_RETURN(auto key, loadStationKey(options.key_file));
  ClientConfig config;
  config.setServers(options.servers);
  config.ca_file = options.ca_file;
  config.program = programText("station");
  config.login = stationLogin(options.station.empty() ? key.station : options.station, key.key);
  config.connect_timeout = kConnectOnceTimeout;
  ASSIGN_OR_RETURN(auto client, BlockingClient::connect(config));
  auto updated = updateCurriculum(
      curriculum, [&](pb::Request request) { return client.call(std::move(request)); },
      options.trainee_given ? options.trainee : std::string(), wallNowNs());
  client.finish();
  return updated;
}

std::vector<ListedExercise> listExercises(const std::vector<CachedLesson>& cached,
                                          const std::optional<std::vector<ServerExercise>>& on_server) {
  std::map<std::string, ListedExercise> by_id;
  for (const CachedLesson& lesson : cached) {
    ListedExercise listed{lesson.exercise_id,     lesson.name,  lesson.profile_id, std::nullopt,
                          lesson.fetched_unix_ns, std::nullopt, lesson.trouble};
    if (lesson.trouble.empty()) listed.cached_revision = lesson.profile_revision;
    if (on_server) listed.on_server = false;
    listed.assigned_only = lesson.assigned_only;
    listed.exam = lesson.exam;
    by_id[lesson.exercise_id] = std::move(listed);
  }
  for (const ServerExercise& exercise : on_server.value_or(std::vector<ServerExercise>{})) {
    ListedExercise& listed = by_id[exercise.exercise_id];
    listed.exercise_id = exercise.exercise_id;
    listed.name = exercise.name;
    listed.profile_id = exercise.profile_id;
    listed.on_server = true;
    listed.assigned_only = exercise.assigned_only;
    listed.exam = exercise.exam;
  }
  std::vector<ListedExercise> all;
  for (auto& [id, listed] : by_id) all.push_back(std::move(listed));
  return all;
}

std::string exerciseListText(const std::vector<ListedExercise>& exercises, std::int64_t now_unix_ns) {
  if (exercises.empty())
    return "no exercise is cached: the window gets what is assigned once the server is there; or give "
           "--profile FILE\n";
  std::size_t id_width = 10, name_width = 6;
  for (const ListedExercise& exercise : exercises) {
    id_width = std::max(id_width, countCharacters(exercise.exercise_id) + 2);
    name_width = std::max(name_width, countCharacters(exercise.name) + 2);
  }
  std::string text =
      padded("EXERCISE", id_width) + padded("NAME", name_width) + padded("EXAM", 6) + "WITHOUT A SERVER\n";
  for (const ListedExercise& exercise : exercises) {
    text += padded(exercise.exercise_id, id_width) + padded(exercise.name, name_width) +
            padded(exercise.exam ? "exam" : "", 6);
    if (exercise.built_in) {
      text += "yes: built in, profile " + exercise.profile_id;
    } else if (exercise.cached_revision) {
      text += fmt::format("yes: profile {}, revision {}", exercise.profile_id, *exercise.cached_revision);
      if (exercise.fetched_unix_ns > 0) {
        const double hours = 1e-9 / 3600 * static_cast<double>(now_unix_ns - exercise.fetched_unix_ns);
        text += ", fetched " + durationText(std::max(0.0, hours)) + " ago";
      }
    } else {
      text += exercise.trouble.empty() ? "not yet: assign it, or practise it once with the server"
                                       : "no: " + exercise.trouble;
    }
    if (exercise.on_server && !*exercise.on_server) text += "; the server does not have it any more";
    text += "\n";
  }
  return text;
}

std::string exerciseListJson(const std::vector<ListedExercise>& exercises, const Ladder& ladder) {
  Json rows = Json::array();
  for (const ListedExercise& exercise : exercises) {
    Json row = {
        {"exercise_id", exercise.exercise_id},
        {"name", exercise.name},
        {"exam", exercise.exam},
        {"profile_id", exercise.profile_id},
        {"cached", exercise.cached_revision.has_value()},
        {"profile_revision", exercise.cached_revision ? Json(*exercise.cached_revision) : Json(nullptr)},
        {"fetched_unix_ns", exercise.fetched_unix_ns > 0 ? Json(exercise.fetched_unix_ns) : Json(nullptr)},
        {"on_server", exercise.on_server ? Json(*exercise.on_server) : Json(nullptr)},
        {"built_in", exercise.built_in},
        {"trouble", exercise.trouble}};
    addStep(row, ladder);
    rows.push_back(std::move(row));
  }
  return reportJson(rows);
}

int runListExercises(const StationOptions& options) {
  const CurriculumCache kept(options.spool, options.key_file);
  Curriculum curriculum = kept.find();
  bool answered = false;
  if (!options.servers.empty()) {
    const Status status = askServerForCurriculum(curriculum, options);
    answered = status.ok();
    if (!answered && status.error().code != ErrorCode::kUnavailable) {
      std::cerr << "station: " << printable(status.error().message) << "\n";
      return exitCodeOf(status.error());
    }
    if (!answered)
      std::cerr << "station: the server is away (" << printable(status.error().message)
                << "); these exercises are in the cache\n";
    // a computer that is not a station yet has no folder for it
    if (answered && std::filesystem::is_directory(options.spool / "lessons"))
      if (const Status status_of_cache = kept.keep(curriculum); !status_of_cache.ok())
        std::cerr << "station: the list is not kept: " << printable(status_of_cache.error().message) << "\n";
  }
  const auto exercises = practisesAlone(options)
                             ? builtInExercises()
                             : listExercises(LessonCache(options.spool).list(),
                                             answered ? std::optional(curriculum.exercises) : std::nullopt);
  const bool some = answered || std::any_of(exercises.begin(), exercises.end(),
                                            [](const auto& exercise) { return exercise.cached_revision; });
  std::string text;
  Ladder ladder;
  if (options.trainee_given && !curriculum.exercises.empty()) {
    ladder = ladderOf(curriculum, options.trainee, wallNowNs());
    text = ladderText(ladder, shownName(curriculum.trainees, options.trainee), !answered) + "\n";
  }
  return printReport(options, text + exerciseListText(exercises, wallNowNs()),
                     exerciseListJson(exercises, ladder), some ? kExitDone : kExitFailed);
}

}  // namespace needlelab
