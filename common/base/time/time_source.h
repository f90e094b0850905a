/// Time for code that waits: the machine's clock in the programs, a simulated one in tests. Code that waits
/// or decides by elapsed time takes a TimeSource and never reads a clock directly.
#pragma once

#include <condition_variable>
#include <csignal>
#include <cstdint>
#include <mutex>

namespace needlelab {

/// Thread: any number of them.
class TimeSource {
 public:
  virtual ~TimeSource() = default;
  /// Monotonic time since some start, in ns. Real-time safe.
  [[nodiscard]] virtual std::int64_t nowNs() noexcept = 0;
  /// Returns when nowNs reaches `due_ns`; at once if that time has passed. Real-time safe.
  virtual void sleepUntilNs(std::int64_t due_ns) noexcept = 0;
  /// Waits with `lock` released until `changed` is notified or nowNs reaches `due_ns`. May return early. A
  /// simulated time just sleeps.
  virtual void waitUntilNs(std::condition_variable& /*changed*/, std::unique_lock<std::mutex>& lock,
                           std::int64_t due_ns) {
    lock.unlock();
    sleepUntilNs(due_ns);
    lock.lock();
  }

  /// Waits until one of `signals` is pending for this thread and takes it, or until `due_ns`. Returns its
  /// number, or 0 if none came. `signals` must be blocked in all threads. May return 0 early. A simulated
  /// time takes a signal that is pending before it sleeps, else one that is pending afterwards.
  virtual int waitForSignalUntilNs(const sigset_t& signals, std::int64_t due_ns) noexcept;

  void sleepForNs(std::int64_t duration_ns) noexcept { sleepUntilNs(nowNs() + duration_ns); }
  /// Waits until `holds()`, at most until `due_ns`; returns whether it holds.
  template <typename Predicate>
  bool waitUntilNs(std::condition_variable& changed, std::unique_lock<std::mutex>& lock, std::int64_t due_ns,
                   Predicate holds) {
    while (!holds()) {
      if (nowNs() >= due_ns) return false;
      waitUntilNs(changed, lock, due_ns);
    }
    return true;
  }
};

/// CLOCK_MONOTONIC. Sleeps until absolute times, so that errors do not accumulate. Open to derivation: the
/// haptic loop's clock polls before the due time (client/station/run/loop/real_time.h).
class MachineTime : public TimeSource {
 public:
  [[nodiscard]] std::int64_t nowNs() noexcept override;
  void sleepUntilNs(std::int64_t due_ns) noexcept override;
  using TimeSource::waitUntilNs;
  void waitUntilNs(std::condition_variable& changed, std::unique_lock<std::mutex>& lock,
                   std::int64_t due_ns) override;
  int waitForSignalUntilNs(const sigset_t& signals, std::int64_t due_ns) noexcept override;
};

/// The machine's time; lives as long as the program.
TimeSource& machineTime() noexcept;

}  // namespace needlelab
