/// needlelab-station: the trainee's program. Handles the command line and uncaught exceptions; station.h has
/// the rest.

#include <exception>
#include <iostream>

#include "client/station/run/calibrate.h"
#include "client/station/run/list_devices.h"
#include "client/station/run/list_exercises.h"
#include "client/station/run/measure_delay.h"
#include "client/station/run/options.h"
#include "client/station/run/self_test.h"
#include "client/station/run/signals.h"
#include "client/station/run/station.h"
#include "client/station/run/station_key.h"
#include "client/station/window/trainee_app.h"
#include "common/base/program.h"
#include "common/base/secret.h"
#include "common/wire/protocol.h"
#include "common/wire/tls.h"

int main(int argc, char** argv) {
  needlelab::keepOutOfCoreDumps();
  needlelab::keepProtobufQuiet();
  // Xlib calls `exit` when the display is lost, and the lesson is sent after that
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
