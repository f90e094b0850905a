/// How long the machine kept a thread from running that wanted to: so that a test that keeps real time can
/// tell a fault of the program from a machine that stood still, and measure again.
#pragma once

#include <atomic>
#include <chrono>
#include <thread>

namespace needlelab::test {

/// A thread that wakes each 5 ms and adds up by how much it was late, where that was more than 15 ms.
class StallWatch {
 public:
  StallWatch() : thread_([this] { run(); }) {}
  ~StallWatch() {
    stop_ = true;
    thread_.join();
  }
  StallWatch(const StallWatch&) = delete;
  StallWatch& operator=(const StallWatch&) = delete;

  /// Stalled since the last call. Any thread.
  std::chrono::milliseconds take() { return std::chrono::milliseconds(stalled_ms_.exchange(0)); }

 private:
  void run() {
    using Clock = std::chrono::steady_clock;
    while (!stop_) {
      const auto due = Clock::now() + std::chrono::milliseconds(5);
      std::this_thread::sleep_until(due);
      const auto late_ms = std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - due).count();
      if (late_ms > 15) stalled_ms_ += late_ms;
    }
  }
  std::atomic<bool> stop_{false};
  std::atomic<long> stalled_ms_{0};
  std::thread thread_;
};

}  // namespace needlelab::test
