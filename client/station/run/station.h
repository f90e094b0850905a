/// A whole lesson at the station: lesson → scene → session → loop → spool and server → summary.
#pragma once

#include <csignal>

#include "client/station/run/options.h"
#include "client/station/run/signals.h"

namespace needlelab {

/// Runs one lesson without a window and prints its summary. `stop_signals`: from blockStopSignals; the first
/// such signal ends the lesson properly, the second one does not wait for the server any more. Gives the
/// program's exit code (base/exit_code.h). Thread: main; starts and joins all others.
int runStation(const StationOptions& options, const sigset_t& stop_signals);

}  // namespace needlelab
