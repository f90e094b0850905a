/// Gets the lesson that a trainee chose: from a profile file, the server, or the cache of the time without
/// it.
#pragma once

#include <functional>

#include "client/station/run/lesson.h"
#include "client/station/run/options.h"
#include "client/station/run/station.h"
#include "client/station/run/trainee_code.h"
#include "common/base/result.h"

namespace needlelab {

struct FetchedLesson {
  StationLesson lesson;
  bool code_checked = false;    ///< the server accepted the trainee's code
  bool code_unchecked = false;  ///< it asks for one otherwise, but is away
  std::string person = {};      ///< "@" and the UUID of the trainee's account; empty: not known
};

/// Asks the server for the lesson, or with a profile file whether it knows the trainee; asks for the code as
/// long as it is missing or wrong. Keeps the lesson, and whether a code is asked for, in the spool. Wipes the
/// code when it returns a lesson. `stopped`: whether to give up waiting. Errors: kCode (no right code, or the
/// server is too busy to check it), kInvalidInput (file, cache, lesson), the server's refusals, kFailed
/// (stopped). A server that is away is an error only if the lesson is not in the cache. Thread: the lesson's.
Result<FetchedLesson> fetchLesson(StationHome& home, const StationOptions& options, GivenCode& code,
                                  const std::function<bool()>& stopped);

}  // namespace needlelab
