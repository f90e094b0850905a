/// What can be practised here, by whom, and with which device: for the Start screen.
#pragma once

#include <functional>
#include <vector>

#include "client/net/spool.h"
#include "client/net/lesson_cache.h"
#include "client/station/run/list_exercises.h"
#include "client/station/run/options.h"
#include "client/station/window/lesson_board.h"

namespace needlelab {

/// Without a server: the cache's exercises; names from the command line and from the spool's sessions.
LessonOffers offersHere(const StationOptions& options, const Spool& spool);
/// Adds what the server has. Errors: those of `ask`; then `offers` is as it was.
Status addServersOffers(LessonOffers& offers, const std::vector<CachedLesson>& cached, const AskServer& ask);

/// How the device of `--device` is; `hangs` becomes true when its driver did not come back. Takes up to 3 s.
DeviceNews deviceNews(const StationOptions& options, bool steered, bool& hangs);

}  // namespace needlelab
