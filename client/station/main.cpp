/// needlelab-station: the trainee's program. Handles the command line and uncaught exceptions, and runs a
/// whole lesson without a window.

#include <csignal>
#include <exception>
#include <iostream>
#include <utility>

#include "client/station/run/checks/calibrate.h"
#include "client/station/run/checks/list_devices.h"
#include "client/station/run/checks/measure_delay.h"
#include "client/station/run/checks/self_test.h"
#include "client/station/run/io/options.h"
#include "client/station/run/io/station_key.h"
#include "client/station/run/io/terminal.h"
#include "client/station/run/lesson/list_exercises.h"
#include "client/station/run/lesson/trainee_code.h"
#include "client/station/run/loop/signals.h"
#include "client/station/run/station.h"
#include "client/station/run/station_run.h"
#include "client/station/window/trainee_app.h"
#include "common/base/program.h"
#include "common/base/secret.h"
#include "common/wire/protocol.h"
#include "common/wire/tls.h"

namespace needlelab {
namespace {

// Runs one lesson without a window and prints its summary. `stop_signals`: from blockStopSignals; the first
// signal ends the lesson properly; the second also ends the wait for the server. Returns the program's exit
// code (common/base/program.h). Thread: main. Starts and joins all others.
int runStation(const StationOptions& options, const sigset_t& stop_signals) {
  LessonObserver nobody;
  StationHome home(options, nobody);
  const auto failed = [](const Status& status) {
    logMessage(status.error().message);
    return exitCodeOf(status.error());
  };
  auto ask_for_code = headlessCodePrompt(options);
  if (!ask_for_code.ok()) return failed(ask_for_code.error());
  if (const Status status = home.openSpool(); !status.ok()) return failed(status);
  if (const Status status = home.connect(); !status.ok()) return failed(status);
  StationRun run(home, options, stop_signals, {"", std::move(*ask_for_code)});
  if (const Status status = run.prepare(); !status.ok()) return failed(status);
  static_cast<void>(run.practise());  // the outcome contains its status
  run.drain();
  const LessonOutcome outcome = run.outcome();
  home.close();
  home.guard().report();
  return run.report(outcome);
}

}  // namespace
}  // namespace needlelab

int main(int argc, char** argv) {
  needlelab::keepOutOfCoreDumps();
  needlelab::keepProtobufQuiet();
  // Xlib calls `exit` when the display is lost; the lesson is sent after that
  needlelab::keepTlsAtExit();
  try {
    const sigset_t stop_signals = needlelab::blockStopSignals();
    const needlelab::ParsedOptions parsed = needlelab::parseStationOptions(argc, argv);
    const auto written = [](int code) { return needlelab::afterOutput(code, "needlelab-station"); };
    if (parsed.exit_code) return written(*parsed.exit_code);
    switch (parsed.options.mode) {
      case needlelab::StationMode::kEnrol:
        return written(needlelab::runEnrol(parsed.options));
      case needlelab::StationMode::kListDevices:
        return written(needlelab::runListDevices(parsed.options));
      case needlelab::StationMode::kListExercises:
        return written(needlelab::runListExercises(parsed.options));
      case needlelab::StationMode::kSelfTest:
        return written(needlelab::runSelfTest(parsed.options, stop_signals));
      case needlelab::StationMode::kCalibrate:
        return written(needlelab::runCalibrate(parsed.options, stop_signals));
      case needlelab::StationMode::kMeasureDelay:
        return written(needlelab::runMeasureDelay(parsed.options, stop_signals));
      case needlelab::StationMode::kLesson:
        break;
    }
    if (!parsed.options.opensWindow()) return written(needlelab::runStation(parsed.options, stop_signals));
    needlelab::endProgram(needlelab::runTrainee(parsed.options, stop_signals));
  } catch (const std::exception& error) {
    // out of memory, or a thread could not start: the spool keeps its data
    std::cerr << "needlelab-station: " << error.what() << "\n";
    return needlelab::kExitFailed;
  }
}
