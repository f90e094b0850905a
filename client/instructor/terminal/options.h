/// The command line of `needlelab-instructor`.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "client/net/connect.h"
#include "common/base/result.h"
#include "common/base/uuid.h"

namespace needlelab {

/// In place of a list of aids: back to those of the exercise.
inline constexpr const char* kResetAids = "reset";

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
  // commands, each sent once and as soon as possible: to an online station, in a lesson that runs, at a
  // moment of it
  std::string message;  ///< to the trainee
  std::string next_exercise;
  std::string aids;   ///< "depth, force", "none", "all", or "reset": those of the exercise
  bool stop = false;  ///< the lesson that runs
  std::string stop_reason;
  std::string annotate;          ///< a remark on the lesson's moment, or on that of `at_s`
  std::optional<double> at_s;    ///< since the session's first sample
  bool once = false;             ///< end when all commands were sent
  std::filesystem::path report;  ///< of --session, an HTML file; needs neither window nor --headless
  // the window
  std::filesystem::path script, screenshot;
  bool off_screen = false;
  double font_scale = 1;
  std::string window_size;  ///< "1280x720"; empty: as it was left

  [[nodiscard]] bool window() const { return !headless && report.empty(); }
};

/// Checks the options together. Errors: kInvalidInput naming the option, its value, and the allowed values.
Status checkOptions(const InstructorOptions& options);

/// In pixels; 1280 × 720 by default. Errors: kInvalidInput, as of checkOptions.
struct WindowSize {
  int width_px = 1280, height_px = 720;
};
Result<WindowSize> windowSizeOf(const InstructorOptions& options);

/// Server, CA and limits, without the log-in. `options` must be checked.
ClientConfig clientConfig(const InstructorOptions& options);

/// The session's 16 bytes. `options` must be checked; empty when there is none.
std::string sessionBytes(const InstructorOptions& options);

}  // namespace needlelab
