#include "client/instructor/terminal/options.h"

#include <charconv>
#include <utility>

#include <fmt/core.h>

namespace needlelab {

Status checkOptions(const InstructorOptions& options) {
  const auto refuse = [](const std::string& text) { return Error{ErrorCode::kInvalidInput, text}; };
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
  RETURN_IF_ERROR(windowSizeOf(options));
  if (!options.session.empty()) {
    if (const auto id = parseUuid(options.session); !id.ok())
      return refuse("--session " + id.error().message);
  }
  const bool station = !options.station.empty(), session = !options.session.empty();
  const bool says = !options.message.empty();
  const std::pair<bool, const char*> wrong[] = {
      {!options.report.empty() && (!session || options.headless || options.replay),
       "--report FILE needs --session ID, and neither --headless nor --replay"},
      {options.headless && !options.screenshot.empty(),
       "--screenshot is of the window: leave --headless out"},
      {station && session, "--station and --session exclude each other: a session runs at one station"},
      {options.replay && !session, "--replay needs --session ID"},
      {options.window() && (says || options.once),
       "--message and --once need --headless: the window has a field for messages"},
      {says && !station, "--message needs --station NAME"},
      {options.once && !says, "--once needs --message"},
  };
  for (const auto& [so, text] : wrong)
    if (so) return refuse(text);
  const struct {
    const char* option;
    double value, least, most;
  } numbers[] = {{"--font-scale", options.font_scale, 0.8, 2.5},
                 {"--at", options.at_s, 0, 1e7},
                 {"--rate", options.rate_hz.value_or(0), 0, 10'000},
                 {"--seconds", options.seconds.value_or(0), 0, 1e7},
                 {"--speed", options.speed, 0, 1000}};
  for (const auto& [option, value, least, most] : numbers)
    if (!(value >= least && value <= most))
      return refuse(fmt::format("{} {:f} is not in [{:f}, {:f}]", option, value, least, most));
  return {};
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
