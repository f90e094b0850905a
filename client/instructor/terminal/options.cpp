#include "client/instructor/terminal/options.h"

#include <charconv>
#include <cmath>
#include <utility>

#include <fmt/core.h>

#include "common/profile/aid_list.h"

namespace needlelab {
namespace {

Status inRange(const char* option, double value, double least, double most) {
  if (std::isfinite(value) && value >= least && value <= most) return {};
  return Error{ErrorCode::kInvalidInput,
               fmt::format("{} {:f} is not in [{:f}, {:f}]", option, value, least, most)};
}

Status refuse(const std::string& text) {
  return Error{ErrorCode::kInvalidInput, text};
}

}  // namespace

Status checkOptions(const InstructorOptions& options) {
  // the window asks for missing values
  if (!options.window()) {
    for (const auto& [name, missing] :
         {std::pair{"--server", options.server.empty()}, std::pair{"--ca", options.ca.empty()},
          std::pair{"--user", options.user.empty()}})
      if (missing) return refuse(std::string(name) + " is required");
  }
  if (!options.server.empty() || !options.window()) {
    if (const auto servers = parseEndpoints(options.server); !servers.ok())
      return refuse("--server " + servers.error().message);
  }
  if (!options.report.empty() && (options.session.empty() || options.headless || options.replay))
    return refuse("--report FILE needs --session ID, and neither --headless nor --replay");
  if (options.headless && !options.screenshot.empty())
    return refuse("--screenshot is of the window: leave --headless out");
  RETURN_IF_ERROR(inRange("--font-scale", options.font_scale, 0.8, 2.5));
  RETURN_IF_ERROR(windowSizeOf(options));
  if (!options.session.empty()) {
    if (const auto id = parseUuid(options.session); !id.ok())
      return refuse("--session " + id.error().message);
    if (!options.station.empty())
      return refuse("--station and --session exclude each other: a session runs at one station");
  }
  if (options.replay && options.session.empty()) return refuse("--replay needs --session ID");
  const bool to_station =
      !options.message.empty() || !options.next_exercise.empty() || !options.aids.empty() || options.stop;
  if (options.window() && (to_station || !options.annotate.empty() || options.once))
    return refuse(
        "--message, --next-exercise, --aids, --stop, --annotate and --once need --headless: the window has "
        "them all");
  if (to_station && options.station.empty())
    return refuse("--message, --next-exercise, --aids and --stop need --station NAME");
  if (!options.aids.empty() && options.aids != kResetAids) {
    if (const auto aids = parseAids(options.aids); !aids.ok())
      return refuse("--aids " + aids.error().message + ", or " + kResetAids);
  }
  if (!options.annotate.empty() && (options.replay || (options.station.empty() && options.session.empty())))
    return refuse("--annotate needs --station NAME, or --session ID without --replay");
  if (options.at_s) {
    if (options.annotate.empty() && options.screenshot.empty())
      return refuse("--at needs --annotate TEXT, or --screenshot FILE");
    RETURN_IF_ERROR(inRange("--at", *options.at_s, 0, 1e7));
  }
  if (options.once && !to_station && options.annotate.empty())
    return refuse("--once needs something to say: --message, --next-exercise, --aids, --stop or --annotate");
  if (options.from_s) {
    if (!options.replay) return refuse("--from needs --replay");
    RETURN_IF_ERROR(inRange("--from", *options.from_s, 0, 1e7));
  }
  if (options.rate_hz) {
    RETURN_IF_ERROR(inRange("--rate", *options.rate_hz, 0, 10'000));
  }
  if (options.seconds) {
    RETURN_IF_ERROR(inRange("--seconds", *options.seconds, 0, 1e7));
  }
  return inRange("--speed", options.speed, 0, 1000);
}

Result<WindowSize> windowSizeOf(const InstructorOptions& options) {
  WindowSize size;
  if (options.window_size.empty()) return size;
  const char* const begin = options.window_size.data();
  const char* const end = begin + options.window_size.size();
  const auto width = std::from_chars(begin, end, size.width_px);
  const bool by = width.ec == std::errc() && width.ptr != end && *width.ptr == 'x';
  const auto height = by ? std::from_chars(width.ptr + 1, end, size.height_px) : width;
  if (by && height.ec == std::errc() && height.ptr == end && size.width_px >= 640 && size.width_px <= 8192 &&
      size.height_px >= 360 && size.height_px <= 8192)
    return size;
  return Error{
      ErrorCode::kInvalidInput,
      "--window '" + options.window_size + "', allowed is WIDTHxHEIGHT in pixels from 640x360 to 8192x8192"};
}

ClientConfig clientConfig(const InstructorOptions& options) {
  ClientConfig config;
  config.setServers(*parseEndpoints(options.server));
  config.ca_file = options.ca;
  config.program = programText("instructor");
  // frames should wait in the server's queue, which drops the oldest, and not in the kernel
  config.limits.socket_buffer_bytes = 256 << 10;
  return config;
}

std::string sessionBytes(const InstructorOptions& options) {
  if (options.session.empty()) return {};
  const Uuid id = *parseUuid(options.session);
  return {id.begin(), id.end()};
}

}  // namespace needlelab
