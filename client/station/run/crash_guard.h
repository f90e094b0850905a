/// A crash of another part of the program takes the force away before it ends the program.
#pragma once

#include "client/station/run/servo_loop.h"

namespace needlelab {

/// While it lives, SIGSEGV, SIGBUS, SIGFPE, SIGILL and SIGABRT (so std::terminate, too: an exception that no
/// thread caught) on any thread but the haptic one ask the loop for zero force (ServoLoop::crashStop), wait
/// at most 200 ms until it has ended and 400 ms for a backend with a thread of its own to send that, and then
/// do what they always did: the program dies by that signal, with its core dump. On the haptic thread itself
/// there is no loop left that could do anything: the program dies 50 ms later, in which a backend with a
/// thread of its own (the Falcon's) misses the loop and sends zero; else the device's own watchdog takes the
/// force away. When that thread itself crashes, or cannot go on, this handler sends the zero (last_word.h).
///
/// One at a time. Thread: made and destroyed by one, while no loop runs; `haptic` on the haptic thread. The
/// loop must outlive it.
class CrashGuard {
 public:
  explicit CrashGuard(ServoLoop& loop);
  ~CrashGuard();
  CrashGuard(const CrashGuard&) = delete;
  CrashGuard& operator=(const CrashGuard&) = delete;

  /// Called by the haptic thread before it runs the loop: that is me.
  static void thisIsTheHapticThread() noexcept;
};

}  // namespace needlelab
