#include "common/base/time_source.h"

#include <time.h>

#include <cerrno>
#include <chrono>

#include "common/base/clock.h"

namespace needlelab {

std::int64_t MachineTime::nowNs() noexcept {
  return steadyNowNs();
}

void MachineTime::sleepUntilNs(std::int64_t due_ns) noexcept {
  constexpr std::int64_t kSecond = 1'000'000'000;
  if (due_ns <= 0) return;
  const timespec wake{static_cast<std::time_t>(due_ns / kSecond), static_cast<long>(due_ns % kSecond)};
  // a signal may wake it early: the absolute time stays the same
  while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr) == EINTR) {
  }
}

void MachineTime::waitUntilNs(std::condition_variable& changed, std::unique_lock<std::mutex>& lock,
                              std::int64_t due_ns) {
  // std::chrono::steady_clock is CLOCK_MONOTONIC here, as nowNs
  const std::chrono::steady_clock::time_point due{std::chrono::nanoseconds(due_ns)};
  changed.wait_until(lock, due);
}

TimeSource& machineTime() noexcept {
  static MachineTime time;
  return time;
}

}  // namespace needlelab
