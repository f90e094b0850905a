/// A thread's work as passes, called by a thread of the machine in the programs, or by a simulated world on
/// one thread in tests (tests/support/time/device_world.h).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

namespace needlelab {

/// Thread: one; a TurnRunner's.
class Turns {
 public:
  virtual ~Turns() = default;
  /// Does one pass. Returns the time of the next call; nothing: the work has ended.
  virtual std::optional<std::int64_t> turn() noexcept = 0;
  /// Waits between two passes until the time that `turn` returned, or until an event that it waits for. If
  /// the time has passed, handles pending events and returns at once.
  virtual void rest(std::int64_t until_ns) noexcept = 0;
};

/// A Turns in progress. The destructor waits for its end, so ask it to end first.
class RunningTurns {
 public:
  virtual ~RunningTurns() = default;
};

struct TurnThread {
  const char* name = "";  ///< for the debugger, at most 15 characters
  int priority = 0;       ///< SCHED_FIFO, ignored without permission; 0: ordinary
};

/// Calls Turns.
class TurnRunner {
 public:
  virtual ~TurnRunner() = default;
  /// `turns` must outlive the result.
  virtual std::unique_ptr<RunningTurns> start(Turns& turns, const TurnThread& thread) = 0;
};

/// Runs each Turns on its own thread of the machine; lives as long as the program.
TurnRunner& machineThreads() noexcept;

}  // namespace needlelab
