/// A clock that a test moves. Code that sleeps or waits moves it to its due time and continues at once.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>

#include "common/base/time/time_source.h"

namespace needlelab::test {

/// Thread: any; but only one thread may sleep, otherwise the time runs away from the others. Fill `late_ns`
/// and `read_cost_ns` before another thread uses it.
class FakeTime : public TimeSource {
 public:
  explicit FakeTime(std::int64_t now_ns = 1'000'000'000) : now_ns_(now_ns) {}

  [[nodiscard]] std::int64_t nowNs() noexcept override {
    return now_ns_.fetch_add(read_cost_ns) + read_cost_ns;
  }
  /// What nowNs would return if reading it cost nothing.
  [[nodiscard]] std::int64_t peekNs() const noexcept { return now_ns_.load(); }
  void sleepUntilNs(std::int64_t due_ns) noexcept override {
    advanceTo(due_ns);
    if (const auto late = late_ns.find(sleeps_++); late != late_ns.end()) advance(late->second);
  }
  void advance(std::int64_t by_ns) noexcept { now_ns_.fetch_add(by_ns); }
  /// Never moves the time back.
  void advanceTo(std::int64_t to_ns) noexcept {
    std::int64_t now_ns = now_ns_.load();
    while (now_ns < to_ns && !now_ns_.compare_exchange_weak(now_ns, to_ns)) {
    }
  }
  /// How often code slept or waited.
  [[nodiscard]] std::uint64_t sleeps() const noexcept { return sleeps_.load(); }

  /// By the number of a sleep, from 0: how much later than due it ends.
  std::map<std::uint64_t, std::int64_t> late_ns;
  /// The cost of each clock read.
  std::int64_t read_cost_ns = 0;

 private:
  std::atomic<std::int64_t> now_ns_;
  std::atomic<std::uint64_t> sleeps_{0};
};

}  // namespace needlelab::test
