/// Exit codes of every binary (DESIGN §5).
#pragma once

#include "common/base/result.h"

namespace needlelab {

inline constexpr int kExitDone = 0;  ///< done; an offline station with its spool safe counts as done
inline constexpr int kExitFailed =
    1;  ///< the work failed: FAULT, verification failed, log-in refused, port taken
inline constexpr int kExitInvalid = 2;  ///< wrong usage or invalid input

inline int exitCodeOf(const Error& error) {
  return error.code == ErrorCode::kInvalidInput ? kExitInvalid : kExitFailed;
}

}  // namespace needlelab
