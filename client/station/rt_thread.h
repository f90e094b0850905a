/// What makes a thread keep its time: each step tells whether it worked, and in words what that means.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace needlelab {

/// One step towards real time. `message` is for a person, also when all went well.
struct RtStep {
  std::string name;  ///< "memory lock", "FIFO priority", "timer slack", "stack"
  bool ok = false;
  std::string message;
};

/// Keeps all memory of the process, present and future, in RAM: no page fault in the loop. For the whole
/// process, once.
RtStep lockMemory();

/// For the calling thread: SCHED_FIFO at `priority` (1-99), timer slack of 1 ns, and a stack that is already
/// mapped. None of them is needed for the loop to run; without them ticks come late when the machine is busy.
std::vector<RtStep> makeThreadRealTime(int priority);

/// Time as the loop sees it; tests put their own in its place. Thread: the loop's. Real-time safe.
class LoopClock {
 public:
  virtual ~LoopClock() = default;
  virtual std::int64_t nowNs() noexcept = 0;
  /// Returns at or after `due_ns` of nowNs, at once when that has passed.
  virtual void sleepUntilNs(std::int64_t due_ns) noexcept = 0;
};

/// CLOCK_MONOTONIC, slept for by absolute time, so that errors do not add up.
class SteadyLoopClock final : public LoopClock {
 public:
  std::int64_t nowNs() noexcept override;
  void sleepUntilNs(std::int64_t due_ns) noexcept override;
};

}  // namespace needlelab
