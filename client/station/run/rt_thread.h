/// What makes a thread keep its time: each step tells whether it worked, and in words what that means.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace needlelab {

/// One step towards real time. `message` is for a person, also when all went well.
struct RtStep {
  std::string name;  ///< "memory lock", "FIFO priority", "timer slack", "stack", "core", …
  bool ok = false;
  std::string message;
};

/// How the haptic thread shall run.
struct RtOptions {
  int priority = 80;       ///< 1-99: above most interrupt threads' users, below the kernel's own watchdogs
  std::optional<int> cpu;  ///< the core that it stays on; none = the system chooses
  bool cpu_needs_fifo = false;  ///< leave the choice to the system where the priority was refused: others
                                ///< would keep an ordinary thread waiting there
  std::int64_t spin_ns = 0;     ///< it wakes so much earlier and watches the clock, 0-200'000
  double rate_hz = 1000;        ///< to say what the spin costs
};

/// Keeps all memory of the process, present and future, in RAM: no page fault in the loop. For the whole
/// process, once.
RtStep lockMemory();

/// For the calling thread: SCHED_FIFO, timer slack of 1 ns, a stack that is already mapped, and, when asked
/// for, one core of its own and the spin. None of them is needed for the loop to run; without them ticks come
/// late when the machine is busy.
std::vector<RtStep> makeThreadRealTime(const RtOptions& options);
/// The same with the defaults of everything else.
std::vector<RtStep> makeThreadRealTime(int priority);

/// For a person: "memory lock, FIFO priority, stack: done", then a line for each step that did not work.
std::vector<std::string> rtStepLines(const std::vector<RtStep>& steps);

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
  /// Sleeps `spin_ns` less than asked and watches the clock for the rest.
  explicit SteadyLoopClock(std::int64_t spin_ns = 0) : spin_ns_(spin_ns) {}
  std::int64_t nowNs() noexcept override;
  void sleepUntilNs(std::int64_t due_ns) noexcept override;

 private:
  std::int64_t spin_ns_;
};

}  // namespace needlelab
