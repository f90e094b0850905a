#include "common/base/time/time_source.h"

#include <time.h>

#include <algorithm>
#include <cerrno>
#include <chrono>

#include "common/base/time/clock.h"

namespace needlelab {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

timespec timespecOf(std::int64_t ns) noexcept {
  return {static_cast<std::time_t>(ns / kSecond), static_cast<long>(ns % kSecond)};
}

// returns 0 if none came within `within_ns`, or if another signal ended the wait
int takeSignal(const sigset_t& signals, std::int64_t within_ns) noexcept {
  const timespec timeout = timespecOf(within_ns);
  return std::max(0, ::sigtimedwait(&signals, nullptr, &timeout));
}

}  // namespace

int TimeSource::waitForSignalUntilNs(const sigset_t& signals, std::int64_t due_ns) noexcept {
  const int pending = takeSignal(signals, 0);
  if (pending != 0 || nowNs() >= due_ns) return pending;
  sleepUntilNs(due_ns);
  return takeSignal(signals, 0);
}

std::int64_t MachineTime::nowNs() noexcept {
  return steadyNowNs();
}

void MachineTime::sleepUntilNs(std::int64_t due_ns) noexcept {
  if (due_ns <= 0) return;
  const timespec wake = timespecOf(due_ns);
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

int MachineTime::waitForSignalUntilNs(const sigset_t& signals, std::int64_t due_ns) noexcept {
  return takeSignal(signals, std::max<std::int64_t>(0, due_ns - nowNs()));
}

TimeSource& machineTime() noexcept {
  static MachineTime time;
  return time;
}

}  // namespace needlelab
