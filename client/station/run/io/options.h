/// The command line of needlelab-station (client/station/README.md, "The command line").
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "client/device/hand/hand.h"
#include "client/device/plunger.h"
#include "client/net/spool/spool.h"
#include "client/station/alarm/tone.h"
#include "client/station/run/loop/fault_watch.h"
#include "client/view/model/letters.h"
#include "common/base/result.h"
#include "common/haptics/geometry.h"
#include "common/wire/endpoint.h"

namespace needlelab {

/// The program's task. Only a lesson and the measurement of the delay send force to the device.
enum class StationMode : std::uint8_t {
  kLesson,
  kListDevices,
  kSelfTest,
  kCalibrate,
  kMeasureDelay,
  kListExercises,
  kEnrol
};

/// A request for a picture of the window.
struct PictureRequest {
  enum class When : std::uint8_t { kStart, kLesson, kEnd };  ///< the screen
  std::filesystem::path file;                                ///< PNG
  When when = When::kLesson;
  double at_s = 0;  ///< kLesson: seconds since the loop's first tick
};

/// The trainee's window.
struct WindowOptions {
  bool start = false;    ///< --start: the first lesson begins at once
  bool may_quit = true;  ///< false: --no-quit
  std::vector<PictureRequest> pictures;
  Viewing viewing;                   ///< --monitor, --viewing-distance; determines the size of letters
  std::optional<double> font_scale;  ///< 0.8-2.5; none: the last value
  bool windowed = false;             ///< --windowed or --window was given; otherwise full screen
  int width_px = 1280, height_px = 720;
  bool size_given = false;          ///< --window was given; otherwise the last size
  std::filesystem::path frame_log;  ///< --frame-log; empty: none
  std::filesystem::path text_log;   ///< --text-log; empty: none
};

struct StationOptions {
  StationMode mode = StationMode::kLesson;
  Endpoints servers;  ///< any of them can serve; empty without --server
  std::filesystem::path ca_file, key_file;
  std::filesystem::path bundle, enrolled;  ///< --enrol FILE; the folder of --enrolled
  std::string station;                     ///< --station, or the name in the key file, or the machine's
  // the lesson
  std::string trainee, exercise;
  std::filesystem::path profile_file;  ///< --profile: a profile from a file
  std::filesystem::path code_file;     ///< --code-file: the trainee's code; empty: asks at the terminal
  std::string model;                   ///< empty: the profile's
  // the device
  std::string device = "simulated";
  HandOptions hand;
  bool passivity_control = false;  ///< --passivity-control
  PlungerSettings plunger;         ///< --plunger; the device determines the source
  bool uncapped = false;           ///< --uncapped: a lesson with PALPATION begins with the cap off
  Pose X_HT, X_WL;                 ///< --tool, --placement
  double rate_hz = 1000;
  double seconds = 0;      ///< 0: the device, the exercise's time limit or a signal ends the lesson
  std::optional<int> cpu;  ///< --cpu: the haptic thread's core; none = the system chooses
  double spin_us = 0;      ///< --spin-us
  std::optional<FaultPolicy> on_fault;     ///< --on-fault; none: wait on a terminal, otherwise end
  std::optional<double> rehearse_fault_s;  ///< --rehearse-fault: after this time
  ToneChoice tone = ToneChoice::kDanger;   ///< --tone
  bool headless = false;
  WindowOptions window;
  bool hand_plan_given = false;  ///< --hand-plan was given
  bool trainee_given = false;    ///< --trainee was given
  /// Returns whether this is a lesson in a window, with a display or (for pictures) without one.
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

/// Options, or an exit code if the program must end at once: help and version (0), wrong usage (2). The
/// parser has already printed the text.
struct ParsedOptions {
  StationOptions options;
  std::optional<int> exit_code;
};
ParsedOptions parseStationOptions(int argc, const char* const* argv);

/// Returns the spool's folder if --spool is not given.
std::filesystem::path defaultSpool();

}  // namespace needlelab
