/// What needlelab-station does instead of a lesson. None of them gives the device a force other than zero.
#pragma once

#include <csignal>

#include "client/station/run/options.h"

namespace needlelab {

/// `--enrol`: logs in by the bundle, then keeps it in `enrolled`. Exit code 0 when both were done, 2 for a
/// bundle that is none.
int runEnrol(const StationOptions& options);
/// `--list-devices`. Exit code 0, whatever is there.
int runListDevices(const StationOptions& options);
/// `--list-exercises`. Exit code 0 when something can be practised without the server, or the server
/// answered.
int runListExercises(const StationOptions& options);
/// `--self-test`. Exit code 0 when no check failed, 1 otherwise.
int runSelfTest(const StationOptions& options, const sigset_t& stop_signals);
/// `--calibrate`. Exit code 0 when a tool was found and written, 1 when not, 2 for wrong input.
int runCalibrate(const StationOptions& options, const sigset_t& stop_signals);

}  // namespace needlelab
