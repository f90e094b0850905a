/// What `needlelab-instructor` was asked to do.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "base/result.h"
#include "base/uuid.h"
#include "net/client.h"

namespace needlelab {

struct InstructorOptions {
  std::string server;
  std::filesystem::path ca;
  std::string user;
  std::filesystem::path password_file;
  bool headless = false;
  bool json = false;
  bool replay = false;
  std::string station;
  std::string session;            ///< text of a UUID
  std::optional<double> rate_hz;  ///< lines per second; 0: every frame of the station
  std::optional<double> from_s;   ///< of a replay: begin so long after the first sample
  double speed = 1;               ///< of a replay; 0: as fast as it comes
  std::optional<double> seconds;  ///< end after so long; none: on Ctrl-C
  std::string message;            ///< to the trainee, once the station is online
  std::string next_exercise;
};

/// What the options mean together. Errors: kInvalidInput naming the option, its value, what is allowed.
Status checkOptions(const InstructorOptions& options);

/// Server, CA and limits, without the log-in. `options` must be checked.
ClientConfig clientConfig(const InstructorOptions& options);

/// The session's 16 bytes. `options` must be checked; empty when there is none.
std::string sessionBytes(const InstructorOptions& options);

}  // namespace needlelab
