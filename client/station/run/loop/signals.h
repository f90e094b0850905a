/// The signals that the station handles one by one on its main thread, and crash signals.
#pragma once

#include <chrono>
#include <csignal>

#include "client/station/run/loop/servo_loop.h"
#include "common/base/time/time_source.h"

namespace needlelab {

/// Blocks SIGINT, SIGTERM, SIGHUP (its terminal closed), SIGQUIT and SIGUSR1 in the calling thread and in all
/// threads that it starts; earlier threads forward these signals to it. If nohup or a shell ignores SIGHUP
/// and SIGQUIT, they stay ignored. Returns all of them except SIGUSR1: these signals end a lesson. SIGUSR1
/// acknowledges a fault and counts only while the loop runs. Ignores SIGPIPE, SIGXFSZ and the signals that
/// suspend a program (Ctrl-Z), because a dead or suspended program leaves the device with its last force.
/// Call it first in `main`.
sigset_t blockStopSignals();

/// Waits at most `time` of `clock` for one of `signals` (TimeSource::waitForSignalUntilNs). Returns its
/// number, or 0 after a timeout.
int signalWithin(const sigset_t& signals, std::chrono::milliseconds time, TimeSource& clock = machineTime());

/// Handles SIGSEGV, SIGBUS, SIGFPE, SIGILL and SIGABRT during its lifetime. SIGABRT includes std::terminate
/// after an uncaught exception.
///
/// After a crash on any other thread than the haptic one, the handler requests zero force from the loop
/// (ServoLoop::crashStop), waits at most 200 ms for the loop's end and 400 ms for a backend with its own
/// thread to send the zero. Then the default action follows: the program dies by that signal, with a core
/// dump.
///
/// After a crash on the haptic thread, the program dies 50 ms later. In that time a backend with its own
/// thread (the Falcon's) notices the missing loop and sends zero; for other devices the device's watchdog
/// removes the force. If the backend's thread crashes or cannot continue, this handler sends the zero
/// (device.h).
///
/// At most one instance. Thread: one thread constructs and destroys it while no loop runs; `setHapticThread`
/// on the haptic thread. The loop and the time must outlive it; the time must be async-signal-safe.
class CrashGuard {
 public:
  explicit CrashGuard(ServoLoop& loop, TimeSource& time = machineTime());
  ~CrashGuard();
  CrashGuard(const CrashGuard&) = delete;
  CrashGuard& operator=(const CrashGuard&) = delete;

  /// The haptic thread calls this before it runs the loop.
  static void setHapticThread() noexcept;
};

}  // namespace needlelab
