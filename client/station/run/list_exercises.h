/// `needlelab-station --list-exercises`: the exercises that can be practised, without a server and with it.
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
  std::optional<std::uint32_t> cached_revision;  ///< of its profile in the cache; none: not cached
  std::int64_t fetched_unix_ns = 0;              ///< 0: not cached, or not known
  std::optional<bool> on_server;                 ///< none: the server was not asked, or did not answer
  std::string trouble;                           ///< why the cached one cannot be used
};

/// An exercise as the server lists it.
struct ServerExercise {
  std::string exercise_id, name, profile_id, description;
};
/// Puts a request to the server: by a connection of one's own, or by the uplink's.
using AskServer = std::function<Result<pb::Reply>(pb::Request)>;
/// All exercises of all courses. Errors: those of `ask`.
Result<std::vector<ServerExercise>> exercisesBy(const AskServer& ask);
/// By a connection for this alone. Errors: as BlockingClient::connect.
Result<std::vector<ServerExercise>> exercisesOfServer(const StationOptions& options);

/// Both together, by id. `on_server`: none when it was not asked or did not answer.
std::vector<ListedExercise> listExercises(const std::vector<CachedLesson>& cached,
                                          const std::optional<std::vector<ServerExercise>>& on_server);

std::string exerciseListText(const std::vector<ListedExercise>& exercises, std::int64_t now_unix_ns);
/// {"version", "machine", "rows": [{"exercise_id", "name", "profile_id", "cached", "profile_revision",
/// "fetched_unix_ns", "on_server", "trouble"}]}
std::string exerciseListJson(const std::vector<ListedExercise>& exercises);

/// `--list-exercises`. Exit code 0 when something can be practised without the server, or the server
/// answered.
int runListExercises(const StationOptions& options);

}  // namespace needlelab
