/// The command line of needlelab-station (../README.md, "The command line").
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "client/device/hand.h"
#include "client/device/plunger.h"
#include "client/net/spool.h"
#include "client/station/run/fault_watch.h"
#include "common/base/result.h"
#include "common/haptics/geometry.h"
#include "common/wire/endpoint.h"

namespace needlelab {

/// The program's task. All but the lesson move nothing: the device gets no force.
enum class StationMode : std::uint8_t {
  kLesson,
  kListDevices,
  kSelfTest,
  kCalibrate,
  kListExercises,
  kEnrol
};

/// When a picture of the window is taken.
struct PictureRequest {
  enum class When : std::uint8_t { kStart, kLesson, kEnd };  ///< which screen
  std::filesystem::path file;                                ///< PNG
  When when = When::kLesson;
  double at_s = 0;  ///< kLesson: seconds since the loop's first tick
};

/// The trainee's window.
struct WindowOptions {
  bool start = false;  ///< --start: the first lesson begins at once
  std::vector<PictureRequest> pictures;
  std::optional<double> font_scale;  ///< 0.8-2.5; none: as it was left
  int width_px = 1280, height_px = 720;
  bool size_given = false;  ///< --window: else as it was left
};

struct StationOptions {
  StationMode mode = StationMode::kLesson;
  // the server; none without --server
  std::optional<Endpoint> server;
  std::filesystem::path ca_file, key_file;
  std::filesystem::path bundle, enrolled;  ///< --enrol FILE; the folder of --enrolled
  std::string station;                     ///< --station, or the name in the key file, or the machine's
  // the lesson
  std::string trainee, exercise;
  std::filesystem::path profile_file;  ///< practice with a profile of one's own
  std::string model;                   ///< empty: the profile's
  // the device
  std::string device = "simulated";
  HandOptions hand;
  PlungerSettings plunger;  ///< --plunger; its source is the device's
  Pose X_HT, X_WL;          ///< --tool, --placement
  double rate_hz = 1000;
  double seconds = 0;      ///< 0: until the device, the exercise's time limit or a signal ends it
  std::optional<int> cpu;  ///< --cpu: the haptic thread's core; none = the system chooses
  double spin_us = 0;      ///< --spin-us
  std::optional<FaultPolicy> on_fault;  ///< --on-fault; none: wait where there is a terminal, else end
  bool headless = false;
  WindowOptions window;
  bool hand_plan_given = false;  ///< --hand-plan was given
  bool trainee_given = false;    ///< --trainee was given
  /// A lesson in a window, on a display or, for pictures, without one.
  [[nodiscard]] bool opensWindow() const { return mode == StationMode::kLesson && !headless; }
  // --calibrate
  bool tool_given = false;         ///< --tool was given
  std::filesystem::path tool_out;  ///< --out: the tool file to write; empty: only report the result
  std::string axis = "from-tip";   ///< --axis, see calibrate.h
  // the spool
  std::filesystem::path spool;
  SpoolKeep keep;
  double drain_s = 10;
  // the summary
  bool json = false;
  std::filesystem::path json_file;  ///< empty with `json`: standard output
};

/// Parses and checks. An exit code when the program is to end at once: help, version (0), or wrong usage (2),
/// which is reported on the terminal already.
struct ParsedOptions {
  StationOptions options;
  std::optional<int> exit_code;
};
ParsedOptions parseStationOptions(int argc, const char* const* argv);

/// Where samples wait when --spool is not given.
std::filesystem::path defaultSpool();

}  // namespace needlelab
