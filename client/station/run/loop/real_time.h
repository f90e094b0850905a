/// Timing of the haptic thread: priority, memory, core, machine settings, and its sleep clock. Each step
/// reports its result and the consequence.
#pragma once

#include <sched.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/base/time/time_source.h"

namespace needlelab {

/// One step towards real time. `message` is for a person, also after success.
struct RtStep {
  std::string name;  ///< "memory lock", "FIFO priority", "timer slack", "stack", "core", …
  bool ok = false;
  std::string message;
};

/// Settings of the haptic thread.
struct RtOptions {
  int priority = 80;            ///< 1-99; above most users of interrupt threads, below the kernel's watchdogs
  std::optional<int> cpu;       ///< the thread's core; none: the system chooses
  bool cpu_needs_fifo = false;  ///< let the system choose if it refused the priority: on a fixed core other
                                ///< threads would delay an ordinary thread
  std::int64_t spin_ns = 0;     ///< wakes this much earlier and polls the clock, 0-200'000
  double rate_hz = 1000;        ///< for the spin's cost in messages
};

/// Locks all present and future memory of the process in RAM, so that the loop has no page faults. Call once
/// per process.
RtStep lockMemory();

/// Sets SCHED_FIFO, 1 ns timer slack, a mapped stack and, on request, a fixed core and the spin for the
/// calling thread. The loop also runs without them, but ticks are late on a busy machine.
std::vector<RtStep> makeThreadRealTime(const RtOptions& options);
/// Likewise, with defaults for all other options.
std::vector<RtStep> makeThreadRealTime(int priority);

/// Returns text for a person: "memory lock, FIFO priority, stack: done", then one line per failed step.
std::vector<std::string> rtStepLines(const std::vector<RtStep>& steps);

/// The machine's time for a loop that must wake on time. Thread: the loop's.
class LoopTime final : public MachineTime {
 public:
  /// Sleeps until `spin_ns` before the due time, then polls the clock.
  explicit LoopTime(std::int64_t spin_ns = 0) : spin_ns_(spin_ns) {}
  void sleepUntilNs(std::int64_t due_ns) noexcept override;

 private:
  std::int64_t spin_ns_;
};

/// Keeps the cores out of deep sleep during its lifetime, because they wake late from it. Holds
/// /dev/cpu_dma_latency at 0, as cyclictest does. The system resets it when the program ends in any way.
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

/// Checks the limit for real-time threads and the frequency governor of the cores. Returns no step for a
/// setting that the machine lacks. `root` is for tests.
std::vector<RtStep> judgeMachine(const RtOptions& options, const std::filesystem::path& root = "/");

/// Returns `wanted`, or the last core that this process may use; none if it may use only one.
std::optional<int> coreForLoop(std::optional<int> wanted);

/// During its lifetime, new threads of the constructing thread run on the other cores. Use it for threads
/// that wait for the disk: a kernel without preemption (Debian's servers, most virtual machines) finishes a
/// system call before a FIFO thread can run on that core. We measured one late tick per second from one
/// fdatasync per second. Does nothing without a core, or if there is only one. Thread: one.
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

/// Returns the number of ticks that last at least `seconds` (>= 0) at `rate_hz` (> 0); at least one.
inline std::uint64_t ticksIn(double seconds, double rate_hz) {
  return static_cast<std::uint64_t>(std::max(1.0, std::ceil(seconds * rate_hz)));
}

}  // namespace needlelab
