/// Gets the lesson that a trainee chose: from a profile file, the server, or the cache while the server is
/// away.
#pragma once

#include <functional>

#include "client/station/run/io/options.h"
#include "client/station/run/lesson/lesson.h"
#include "client/station/run/lesson/trainee_code.h"
#include "client/station/run/station.h"
#include "common/base/result.h"

namespace needlelab {

struct FetchedLesson {
  StationLesson lesson;
  bool code_checked = false;    ///< the server accepted the trainee's code
  bool code_unchecked = false;  ///< the server normally asks for one, but is away
  std::string person = {};      ///< "@" and the UUID of the trainee's account; empty: not known
};

/// Asks the server for the lesson, or with a profile file whether it knows the trainee; asks for the code
/// while it is missing or wrong. Stores the lesson, and whether a code is asked for, in the spool. Wipes the
/// code when it returns a lesson. `stopped`: whether to stop waiting. Errors: kCode (no right code, or the
/// server is too busy to check it), kInvalidInput (file, cache, lesson), the server's refusals, kFailed
/// (stopped). An absent server is an error only if the lesson is not in the cache. Thread: the lesson's.
Result<FetchedLesson> fetchLesson(StationHome& home, const StationOptions& options, GivenCode& code,
                                  const std::function<bool()>& stopped);

}  // namespace needlelab
