/// Simulated time and the threads that live in it, on one real thread: a haptic thread, a device's own
/// threads, the keeper and the owner take turns in the order of their due times. The same calls give the same
/// run. Modelled on the simulators of FoundationDB and TigerBeetle.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <string>

#include "client/device/turns.h"
#include "common/base/time/time_source.h"
#include "tests/support/random.h"

namespace needlelab::test {

inline constexpr std::int64_t kMs = 1'000'000;
inline constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

/// Code that sleeps, or waits for a thread to end, lets the others run in the meantime. A thread that sleeps
/// within its turn can wake only after those that later went to sleep within their turns; so at most one
/// thread besides the owner may do that. Thread: one.
class DeviceWorld final : public TimeSource, public TurnRunner {
 public:
  /// `seed` decides the order of threads due at the same time; 0: the order in which they began.
  explicit DeviceWorld(std::uint64_t seed = 0) : order_(seed), is_shuffled_(seed != 0) {}

  [[nodiscard]] std::int64_t nowNs() noexcept override { return now_ns_; }
  /// Runs everything that is due until then.
  void sleepUntilNs(std::int64_t due_ns) noexcept override;
  /// The first turn is due at once.
  std::unique_ptr<RunningTurns> start(Turns& turns, const TurnThread& thread) override;

  /// Threads of this name that begin later are also woken at the time `next_event_ns`.
  void listen(const std::string& name, std::function<std::int64_t()> next_event_ns);
  /// Each wake-up of threads of this name that begin later is late by the value of `late_ns`.
  void wakeLate(const std::string& name, std::function<std::int64_t()> late_ns);
  /// Runs it once, between the threads' turns.
  void at(std::int64_t due_ns, std::function<void()> happens);

 private:
  struct Thread {
    Turns* turns;
    std::string name;
    std::int64_t due_ns, late_ns = 0;
    bool is_new = true, is_busy = false, has_ended = false, is_free = false;
  };
  class Running;

  [[nodiscard]] std::int64_t wakeNs(const Thread& thread) const;
  bool next(std::int64_t until_ns);
  void turn(Thread& thread);

  std::int64_t now_ns_ = 1'000 * kMs;
  Random order_;
  bool is_shuffled_;
  std::deque<Thread> threads_;  // a deque keeps a thread's address
  std::map<std::string, std::function<std::int64_t()>> events_, lateness_;
  std::multimap<std::int64_t, std::function<void()>> once_;
  int at_this_time_ = 0;
};

}  // namespace needlelab::test
