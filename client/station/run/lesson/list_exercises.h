/// `needlelab-station --list-exercises`: the ladder of --trainee, and the exercises available with and
/// without a server.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/net/spool/lesson_cache.h"
#include "client/station/run/io/options.h"
#include "client/station/run/lesson/curriculum.h"
#include "client/station/run/lesson/ladder.h"

namespace needlelab {

struct ListedExercise {
  std::string exercise_id, name, profile_id;
  std::optional<std::uint32_t> cached_revision;  ///< revision of its profile in the cache; none: not cached
  std::int64_t fetched_unix_ns = 0;              ///< 0: not cached, or unknown
  std::optional<bool> on_server;                 ///< none: the server was not asked or did not answer
  std::string trouble;                           ///< why the cached exercise is unusable
  bool assigned_only = false;                    ///< only trainees to whom it is assigned may take it
  bool exam = false;                             ///< belongs to an exam
  bool built_in = false;                         ///< travels with the program (built_in.h)
};

/// Updates `curriculum` over a separate connection, with the standing of --trainee if it is given. Errors:
/// from BlockingClient::connect, and as updateCurriculum.
Status askServerForCurriculum(Curriculum& curriculum, const StationOptions& options);

/// Merges both lists, sorted by id. `on_server`: none if the server was not asked or did not answer.
std::vector<ListedExercise> listExercises(const std::vector<CachedLesson>& cached,
                                          const std::optional<std::vector<ServerExercise>>& on_server);

std::string exerciseListText(const std::vector<ListedExercise>& exercises, std::int64_t now_unix_ns);
/// {"version", "machine", "rows": [{"exercise_id", "name", "exam", "profile_id", "cached",
/// "profile_revision", "fetched_unix_ns", "on_server", "built_in", "trouble"}]}. The rows of `ladder` also
/// have "section", "step" (null: none), "state", "locked_by", "attempts_left", "due_unix_ns" and
/// "as_of_unix_ns", where null means unknown, unlimited or never.
std::string exerciseListJson(const std::vector<ListedExercise>& exercises, const Ladder& ladder = {});

/// Runs `--list-exercises`. Exit code 0 if an exercise is available without the server, or the server
/// answered.
int runListExercises(const StationOptions& options);

}  // namespace needlelab
