/// The signals that the station takes one by one, on its main thread.
#pragma once

#include <chrono>
#include <csignal>

namespace needlelab {

/// Blocks SIGINT, SIGTERM, SIGHUP (its terminal is closed), SIGQUIT and SIGUSR1 in the calling thread and all
/// that it starts; threads that were there before hand them over to it. SIGHUP and SIGQUIT stay ignored where
/// nohup or a shell had them ignored. Gives all but SIGUSR1: they end a lesson; SIGUSR1 acknowledges a fault
/// and counts only while the loop runs. Ignores SIGPIPE, SIGXFSZ and what would stop the program (Ctrl-Z):
/// one that dies or stands still leaves the device with its last force. Call it first in `main`.
sigset_t blockStopSignals();

/// Takes one of `signals`: its number, or 0 when `time` passed.
int signalWithin(const sigset_t& signals, std::chrono::milliseconds time);

}  // namespace needlelab
