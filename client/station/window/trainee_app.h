/// needlelab-station with its window.
#pragma once

#include <csignal>

#include "client/station/run/options.h"

namespace needlelab {

/// Lessons in a window until a person closes it, a stop signal comes or the display goes; without a display,
/// for pictures only, one lesson. `stop_signals`: from blockStopSignals. Gives the program's exit code. The
/// lessons run on a thread of their own: what happens to the window (closed, gone, slow) ends or delays no
/// tick; a lesson that runs when it goes is ended as by its stop, stored and sent. Thread: main (GLFW).
int runTrainee(const StationOptions& options, const sigset_t& stop_signals);

}  // namespace needlelab
