/// The command line of `needlelab-instructor`.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "client/net/link/connect.h"
#include "common/base/result.h"
#include "common/base/text/uuid.h"

namespace needlelab {

struct InstructorOptions {
  std::string server;  ///< HOST:PORT, or several equivalent ones
  std::filesystem::path ca;
  std::string user;
  std::filesystem::path password_file;
  bool headless = false;
  bool json = false;
  bool replay = false;
  std::string station;
  std::string session;            ///< text of a UUID
  std::optional<double> rate_hz;  ///< lines per second; 0: every frame from the station
  double speed = 1;               ///< replay; 0: as fast as possible
  std::optional<double> seconds;  ///< end after this time; none: on Ctrl-C
  std::string message;            ///< to the trainee; sent once, as soon as the station is online
  bool once = false;              ///< end after sending it
  std::filesystem::path
      report;            ///< HTML file with the report on --session; needs neither window nor --headless
  bool replace = false;  ///< `report` may exist already
  // the window
  std::filesystem::path screenshot;
  double at_s = 2;  ///< time of the screenshot, since the window opened
  bool off_screen = false;
  double font_scale = 1;
  std::string window_size;  ///< "1280x720"; empty: the last size

  [[nodiscard]] bool window() const { return !headless && report.empty(); }
};

/// Checks the combination of options. Errors: kInvalidInput, naming the option, its value, and the allowed
/// values.
Status checkOptions(const InstructorOptions& options);

/// In pixels; 1280 × 720 by default. Errors: kInvalidInput, as in checkOptions.
struct WindowSize {
  int width_px = 1280, height_px = 720;
};
Result<WindowSize> windowSizeOf(const InstructorOptions& options);

/// Returns servers, CA and limits, without the log-in. `options` must be checked.
ClientConfig clientConfig(const InstructorOptions& options);

/// Returns the session's 16 bytes; empty if no session was given. `options` must be checked.
std::string sessionBytes(const InstructorOptions& options);

}  // namespace needlelab
