#include "instructor/options.h"

#include <cmath>

namespace needlelab {
namespace {

Status inRange(const char* option, double value, double least, double most) {
  if (std::isfinite(value) && value >= least && value <= most) return {};
  return Error{ErrorCode::kInvalidInput, std::string(option) + " " + std::to_string(value) + " is not in [" +
                                             std::to_string(least) + ", " + std::to_string(most) + "]"};
}

Status refuse(const std::string& text) {
  return Error{ErrorCode::kInvalidInput, text};
}

}  // namespace

Status checkOptions(const InstructorOptions& options) {
  if (const auto server = parseEndpoint(options.server); !server.ok())
    return refuse("--server " + server.error().message);
  if (!options.session.empty()) {
    if (const auto id = parseUuid(options.session); !id.ok())
      return refuse("--session " + id.error().message);
    if (!options.station.empty())
      return refuse("--station and --session exclude each other: a session runs at one station");
  }
  if (options.replay && options.session.empty()) return refuse("--replay needs --session ID");
  if ((!options.message.empty() || !options.next_exercise.empty()) && options.station.empty()) {
    return refuse("--message and --next-exercise need --station NAME");
  }
  if (options.from_s) {
    if (!options.replay) return refuse("--from needs --replay");
    if (auto ok = inRange("--from", *options.from_s, 0, 1e7); !ok.ok()) return ok;
  }
  if (options.rate_hz) {
    if (auto ok = inRange("--rate", *options.rate_hz, 0, 10'000); !ok.ok()) return ok;
  }
  if (options.seconds) {
    if (auto ok = inRange("--seconds", *options.seconds, 0, 1e7); !ok.ok()) return ok;
  }
  return inRange("--speed", options.speed, 0, 1000);
}

ClientConfig clientConfig(const InstructorOptions& options) {
  ClientConfig config;
  config.server = *parseEndpoint(options.server);
  config.ca_file = options.ca;
  config.program = programText("instructor");
  // frames should wait in the server's queue, where the old ones are dropped, rather than in the kernel
  config.limits.socket_buffer_bytes = 256 << 10;
  return config;
}

std::string sessionBytes(const InstructorOptions& options) {
  if (options.session.empty()) return {};
  const Uuid id = *parseUuid(options.session);
  return {id.begin(), id.end()};
}

}  // namespace needlelab
