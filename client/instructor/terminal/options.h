/// The command line of `needlelab-instructor`.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "client/net/connect.h"
#include "common/base/result.h"
#include "common/base/uuid.h"

namespace needlelab {

/// Replaces a list of aids: back to the exercise's aids.
inline constexpr const char* kResetAids = "reset";

struct InstructorOptions {
  std::string server;  ///< HOST:PORT, or several of which any will do
  std::filesystem::path ca;
  std::string user;
  std::filesystem::path password_file;
  bool headless = false;
  bool json = false;
  bool replay = false;
  std::string station;
  std::string session;            ///< text of a UUID
  std::optional<double> rate_hz;  ///< lines per second; 0: every frame of the station
  std::optional<double> from_s;   ///< replay: start this long after the first sample
  double speed = 1;               ///< replay; 0: as fast as possible
  std::optional<double> seconds;  ///< end after this time; none: on Ctrl-C
  // commands, each sent once and as soon as possible: to an online station, in a running lesson, at a moment
  // of it
  std::string message;  ///< to the trainee
  std::string next_exercise;
  std::string aids;   ///< "depth, force", "none", "all", or "reset" for the exercise's aids
  bool stop = false;  ///< stop the running lesson
  std::string stop_reason;
  std::string annotate;        ///< a remark on the lesson's present moment, or on `at_s`
  std::optional<double> at_s;  ///< since the session's first sample
  bool once = false;           ///< end after sending all commands
  std::filesystem::path
      report;            ///< HTML file with the report on --session; needs neither window nor --headless
  bool replace = false;  ///< `report` may be there already
  // the window
  std::filesystem::path screenshot;
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

/// Returns the session's 16 bytes; empty without a session. `options` must be checked.
std::string sessionBytes(const InstructorOptions& options);

}  // namespace needlelab
