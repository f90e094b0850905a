/// The signals that the station takes one by one, on its main thread, and those of a crash.
#pragma once

#include <chrono>
#include <csignal>

#include "client/station/run/servo_loop.h"

namespace needlelab {

/// Blocks SIGINT, SIGTERM, SIGHUP (its terminal is closed), SIGQUIT and SIGUSR1 in the calling thread and all
/// that it starts; threads that were there before hand them over to it. SIGHUP and SIGQUIT stay ignored where
/// nohup or a shell had them ignored. Returns all but SIGUSR1: they end a lesson; SIGUSR1 acknowledges a
/// fault and counts only while the loop runs. Ignores SIGPIPE, SIGXFSZ and the signals that would stop the
/// program (Ctrl-Z): a program that dies or stands still leaves the device with its last force. Call it first
/// in `main`.
sigset_t blockStopSignals();

/// Takes one of `signals`: its number, or 0 when `time` passed.
int signalWithin(const sigset_t& signals, std::chrono::milliseconds time);

/// While it lives, SIGSEGV, SIGBUS, SIGFPE, SIGILL and SIGABRT (so std::terminate, too: an exception that no
/// thread caught) on any thread but the haptic one ask the loop for zero force (ServoLoop::crashStop), wait
/// at most 200 ms until it has ended and 400 ms for a backend with a thread of its own to send that, and then
/// take their default action: the program dies by that signal, with its core dump. After a crash on the
/// haptic thread itself no loop is left: the program dies 50 ms later, in which a backend with a thread of
/// its own (the Falcon's) misses the loop and sends zero; else the device's own watchdog takes the force
/// away. When that thread itself crashes, or cannot go on, this handler sends the zero (crash_packet.h).
///
/// One at a time. Thread: made and destroyed by one, while no loop runs; `setHapticThread` on the
/// haptic thread. The loop must outlive it.
class CrashGuard {
 public:
  explicit CrashGuard(ServoLoop& loop);
  ~CrashGuard();
  CrashGuard(const CrashGuard&) = delete;
  CrashGuard& operator=(const CrashGuard&) = delete;

  /// Called by the haptic thread before it runs the loop.
  static void setHapticThread() noexcept;
};

}  // namespace needlelab
