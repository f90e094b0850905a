/// `needlelab-station --list-exercises`: lists the exercises available with and without a server.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/net/lesson_cache.h"
#include "client/station/run/options.h"
#include "needlelab/control.pb.h"

namespace needlelab {

struct ListedExercise {
  std::string exercise_id, name, profile_id;
  std::optional<std::uint32_t> cached_revision;  ///< revision of its profile in the cache; none: not cached
  std::int64_t fetched_unix_ns = 0;              ///< 0: not cached, or unknown
  std::optional<bool> on_server;  ///< none: the station did not ask the server, or got no answer
  std::string trouble;            ///< why the cached exercise is unusable
};

/// An exercise as the server lists it.
struct ServerExercise {
  std::string exercise_id, name, profile_id, description;
};
/// Sends a request to the server, over a separate connection or the uplink's.
using AskServer = std::function<Result<pb::Reply>(pb::Request)>;
/// Returns all exercises of all courses. Errors: from `ask`.
Result<std::vector<ServerExercise>> exercisesBy(const AskServer& ask);
/// The same over a separate connection. Errors: from BlockingClient::connect.
Result<std::vector<ServerExercise>> exercisesOfServer(const StationOptions& options);

/// Merges both lists, sorted by id. `on_server`: none if the server was not asked or did not answer.
std::vector<ListedExercise> listExercises(const std::vector<CachedLesson>& cached,
                                          const std::optional<std::vector<ServerExercise>>& on_server);

std::string exerciseListText(const std::vector<ListedExercise>& exercises, std::int64_t now_unix_ns);
/// {"version", "machine", "rows": [{"exercise_id", "name", "profile_id", "cached", "profile_revision",
/// "fetched_unix_ns", "on_server", "trouble"}]}
std::string exerciseListJson(const std::vector<ListedExercise>& exercises);

/// Runs `--list-exercises`. Exit code 0 if an exercise is available without the server, or the server
/// answered.
int runListExercises(const StationOptions& options);

}  // namespace needlelab
