/// Measures how long the machine kept runnable threads from running. A real-time test can thus tell a program
/// fault from a stalled or busy machine, and measure again.
#pragma once

#include <pthread.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

namespace needlelab::test {

/// A thread that wakes every 5 ms and adds up its delays of more than 15 ms.
class StallWatch {
 public:
  /// `real_time`: the thread runs at real-time priority where that is allowed, so that it sees only stalls
  /// that stop even a real-time thread.
  explicit StallWatch(bool real_time = false) : thread_([this] { run(); }) {
    const sched_param parameters{.sched_priority = 90};
    if (real_time) (void)::pthread_setschedparam(thread_.native_handle(), SCHED_FIFO, &parameters);
  }
  ~StallWatch() {
    stop_ = true;
    thread_.join();
  }
  StallWatch(const StallWatch&) = delete;
  StallWatch& operator=(const StallWatch&) = delete;

  /// Stall time since the last call. Any thread.
  std::chrono::milliseconds take() { return std::chrono::milliseconds(stalled_ms_.exchange(0)); }

 private:
  void run() {
    const auto now = [] { return std::chrono::steady_clock::now(); };
    while (!stop_) {
      const auto due = now() + std::chrono::milliseconds(5);
      std::this_thread::sleep_until(due);
      const auto late_ms = std::chrono::duration_cast<std::chrono::milliseconds>(now() - due).count();
      if (late_ms > 15) stalled_ms_ += late_ms;
    }
  }
  std::atomic<bool> stop_{false};
  std::atomic<long> stalled_ms_{0};
  std::thread thread_;
};

/// Total time that this process's current threads were ready to run without a core (proc(5), schedstat), plus
/// the time that the host gave its cores to others (stat, steal). Never decreases while no thread ends.
inline std::chrono::milliseconds waitedForCores() {
  std::uint64_t all_ns = 0;
  std::error_code error;
  for (auto at = std::filesystem::directory_iterator("/proc/self/task", error);
       !error && at != std::filesystem::directory_iterator(); at.increment(error)) {
    std::uint64_t ran_ns = 0, waited_ns = 0;
    if (std::ifstream(at->path() / "schedstat") >> ran_ns >> waited_ns) all_ns += waited_ns;
  }
  std::ifstream stat("/proc/stat");
  std::string cpu;
  stat >> cpu;
  std::uint64_t ticks = 0;  // of 10 ms; the eighth is the steal time
  for (int i = 0; i < 8; ++i) stat >> ticks;
  return std::chrono::milliseconds(all_ns / 1'000'000 + ticks * 10);
}

}  // namespace needlelab::test
