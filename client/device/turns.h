/// The work of a thread as passes that somebody else calls: a thread of the machine in the programs, a
/// simulated world on one thread in tests (tests/support/device_world.h).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

namespace needlelab {

/// Thread: one; a TurnRunner's.
class Turns {
 public:
  virtual ~Turns() = default;
  /// Does one pass. Returns when it wants to be called next; nothing: the work has ended.
  virtual std::optional<std::int64_t> turn() noexcept = 0;
  /// Waits between two passes until the time that `turn` returned, or until something happens that it waits
  /// for. With a time that has passed it handles what has happened and returns at once.
  virtual void rest(std::int64_t until_ns) noexcept = 0;
};

/// A Turns that somebody calls. The destructor waits for its end, so ask it to end before.
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

/// A thread of the machine for each Turns; lives as long as the program.
TurnRunner& machineThreads() noexcept;

}  // namespace needlelab
