/// Explains to an instructor why there is no connection, and what to do about it.
#pragma once

#include <string>

#include "common/base/result.h"

namespace needlelab {

struct LinkTrouble {
  std::string what;  ///< one sentence: "No needlelab-server answers at lab.example:7750."
  std::string todo;  ///< one or two: what a person can do; never empty when `what` is not
  /// Trying again by itself makes no sense: another password, file or program is needed.
  bool needs_person = false;
  std::string detail;  ///< the error itself, for the lab's administrator
};

/// `server`: HOST:PORT as typed. Errors as connectClient gives them.
LinkTrouble troubleOf(const Error& error, const std::string& server);

}  // namespace needlelab
