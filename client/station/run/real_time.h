/// Timing of the haptic thread: priority, memory, its core, the machine's own settings, and the clock that it
/// sleeps by. Each step reports whether it worked and what that means.
#pragma once

#include <sched.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
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
  double rate_hz = 1000;        ///< for the spin's cost in messages
};

/// Keeps all memory of the process, present and future, in RAM: no page fault in the loop. For the whole
/// process, once.
RtStep lockMemory();

/// For the calling thread: SCHED_FIFO, timer slack of 1 ns, a stack that is already mapped, and, on request,
/// one core of its own and the spin. None of them is needed for the loop to run; without them ticks come late
/// when the machine is busy.
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
  /// Sleeps until `spin_ns` before the due time and watches the clock for the rest.
  explicit SteadyLoopClock(std::int64_t spin_ns = 0) : spin_ns_(spin_ns) {}
  std::int64_t nowNs() noexcept override;
  void sleepUntilNs(std::int64_t due_ns) noexcept override;

 private:
  std::int64_t spin_ns_;
};

/// While it lives the cores do not fall into deep sleep, from which they wake late: it holds
/// /dev/cpu_dma_latency at 0, as cyclictest does. The system forgets it when the program ends, however.
/// Thread: one.
class ShallowSleep {
 public:
  explicit ShallowSleep(const std::filesystem::path& file = "/dev/cpu_dma_latency");
  ~ShallowSleep();
  ShallowSleep(const ShallowSleep&) = delete;
  ShallowSleep& operator=(const ShallowSleep&) = delete;
  [[nodiscard]] const RtStep& step() const { return step_; }

 private:
  int file_ = -1;
  RtStep step_;
};

/// Checks the limit for real-time threads and the cores' clock (governor). A machine without such a setting
/// gives no step. `root` is for tests.
std::vector<RtStep> judgeMachine(const RtOptions& options, const std::filesystem::path& root = "/");

/// `wanted`, or else the last of the cores that this process may use; none when it may use only one.
std::optional<int> coreForLoop(std::optional<int> wanted);

/// Threads that are made while it lives, by the thread that made it, run on the other cores. For threads that
/// wait for the disk: a kernel without preemption (Debian's servers, most virtual machines) finishes a system
/// call before it lets even a FIFO thread run on that core. One late tick a second was seen, of one fdatasync
/// a second. Nothing happens without a core, or when it is the only one. Thread: one.
class KeepOffCore {
 public:
  explicit KeepOffCore(std::optional<int> core);
  ~KeepOffCore();
  KeepOffCore(const KeepOffCore&) = delete;
  KeepOffCore& operator=(const KeepOffCore&) = delete;

 private:
  cpu_set_t before_;
  bool narrowed_ = false;
};

/// The ticks that last at least `seconds` (>= 0) at `rate_hz` (> 0): one at least.
inline std::uint64_t ticksIn(double seconds, double rate_hz) {
  return static_cast<std::uint64_t>(std::max(1.0, std::ceil(seconds * rate_hz)));
}

}  // namespace needlelab
