#include "client/station/run/list_exercises.h"

#include <fmt/core.h>

#include <algorithm>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "client/net/blocking_client.h"
#include "client/net/spool_outlook.h"
#include "client/station/run/report_output.h"
#include "client/station/run/station_key.h"
#include "common/base/clock.h"
#include "common/base/program.h"
#include "common/base/text.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

using Json = nlohmann::ordered_json;

std::string textAt(const nlohmann::json& json, const char* key) {
  const auto at = json.is_object() ? json.find(key) : json.end();
  return at != json.end() && at->is_string() ? printable(at->get<std::string>()) : std::string();
}

}  // namespace

Result<std::vector<ServerExercise>> exercisesOfServer(const StationOptions& options) {
  ASSIGN_OR_RETURN(auto key, loadStationKey(options.key_file));
  ClientConfig config;
  config.server = *options.server;
  config.ca_file = options.ca_file;
  config.program = programText("station");
  config.login = stationLogin(options.station.empty() ? key.station : options.station, key.key);
  ASSIGN_OR_RETURN(auto client, BlockingClient::connect(config));
  auto exercises = exercisesBy([&](pb::Request request) { return client.call(std::move(request)); });
  client.finish();
  return exercises;
}

Result<std::vector<ServerExercise>> exercisesBy(const AskServer& ask) {
  pb::Request request;
  request.mutable_list_curricula();
  ASSIGN_OR_RETURN(const auto curricula, ask(request));
  std::vector<ServerExercise> exercises;
  for (const pb::CurriculumSummary& summary : curricula.curricula().curricula()) {
    request.mutable_get_curriculum()->set_id(summary.id());
    ASSIGN_OR_RETURN(const auto reply, ask(request));
    const auto curriculum = nlohmann::json::parse(reply.curriculum().json(), nullptr, false);
    if (!curriculum.is_object() || !curriculum.contains("exercises") || !curriculum["exercises"].is_array())
      continue;
    for (const auto& exercise : curriculum["exercises"])
      exercises.push_back({textAt(exercise, "id"), textAt(exercise, "name"), textAt(exercise, "profile_id"),
                           textAt(exercise, "description")});
  }
  return exercises;
}

std::vector<ListedExercise> listExercises(const std::vector<CachedLesson>& cached,
                                          const std::optional<std::vector<ServerExercise>>& on_server) {
  std::map<std::string, ListedExercise> by_id;
  for (const CachedLesson& lesson : cached) {
    ListedExercise listed{lesson.exercise_id,     lesson.name,  lesson.profile_id, std::nullopt,
                          lesson.fetched_unix_ns, std::nullopt, lesson.trouble};
    if (lesson.trouble.empty()) listed.cached_revision = lesson.profile_revision;
    if (on_server) listed.on_server = false;
    by_id[lesson.exercise_id] = std::move(listed);
  }
  for (const ServerExercise& exercise : on_server.value_or(std::vector<ServerExercise>{})) {
    ListedExercise& listed = by_id[exercise.exercise_id];
    listed.exercise_id = exercise.exercise_id;
    listed.name = exercise.name;
    listed.profile_id = exercise.profile_id;
    listed.on_server = true;
  }
  std::vector<ListedExercise> all;
  for (auto& [id, listed] : by_id) all.push_back(std::move(listed));
  return all;
}

std::string exerciseListText(const std::vector<ListedExercise>& exercises, std::int64_t now_unix_ns) {
  if (exercises.empty())
    return "no exercise is cached: connect to the server and practise it once, or give --profile FILE\n";
  std::size_t id_width = 10, name_width = 6;
  for (const ListedExercise& exercise : exercises) {
    id_width = std::max(id_width, columnsOf(exercise.exercise_id) + 2);
    name_width = std::max(name_width, columnsOf(exercise.name) + 2);
  }
  std::string text = padded("EXERCISE", id_width) + padded("NAME", name_width) + "WITHOUT A SERVER\n";
  for (const ListedExercise& exercise : exercises) {
    text += padded(exercise.exercise_id, id_width) + padded(exercise.name, name_width);
    if (exercise.cached_revision) {
      text += fmt::format("yes: profile {}, revision {}", exercise.profile_id, *exercise.cached_revision);
      if (exercise.fetched_unix_ns > 0) {
        const double hours = 1e-9 / 3600 * static_cast<double>(now_unix_ns - exercise.fetched_unix_ns);
        text += ", fetched " + durationText(std::max(0.0, hours)) + " ago";
      }
    } else {
      text +=
          exercise.trouble.empty() ? "not yet: practise it once with the server" : "no: " + exercise.trouble;
    }
    if (exercise.on_server && !*exercise.on_server) text += "; the server does not have it any more";
    text += "\n";
  }
  return text;
}

std::string exerciseListJson(const std::vector<ListedExercise>& exercises) {
  Json rows = Json::array();
  for (const ListedExercise& exercise : exercises)
    rows.push_back(
        {{"exercise_id", exercise.exercise_id},
         {"name", exercise.name},
         {"profile_id", exercise.profile_id},
         {"cached", exercise.cached_revision.has_value()},
         {"profile_revision", exercise.cached_revision ? Json(*exercise.cached_revision) : Json(nullptr)},
         {"fetched_unix_ns", exercise.fetched_unix_ns > 0 ? Json(exercise.fetched_unix_ns) : Json(nullptr)},
         {"on_server", exercise.on_server ? Json(*exercise.on_server) : Json(nullptr)},
         {"trouble", exercise.trouble}});
  return reportJson(rows);
}

int runListExercises(const StationOptions& options) {
  std::optional<std::vector<ServerExercise>> on_server;
  if (options.server) {
    auto answer = exercisesOfServer(options);
    if (answer.ok())
      on_server = std::move(*answer);
    else if (answer.error().code == ErrorCode::kUnavailable)
      std::cerr << "station: the server is away (" << printable(answer.error().message)
                << "); these exercises are in the cache\n";
    else {
      std::cerr << "station: " << printable(answer.error().message) << "\n";
      return exitCodeOf(answer.error());
    }
  }
  const auto exercises = listExercises(LessonCache(options.spool).list(), on_server);
  const bool some = on_server || std::any_of(exercises.begin(), exercises.end(),
                                             [](const auto& exercise) { return exercise.cached_revision; });
  return printReport(options, exerciseListText(exercises, wallNowNs()), exerciseListJson(exercises),
                     some ? kExitDone : kExitFailed);
}

}  // namespace needlelab
