#include "station/rt_thread.h"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>

#include "base/clock.h"

namespace needlelab {
namespace {

constexpr std::size_t kStackBytes = 256 * 1024;  // more than the loop ever uses

RtStep step(const char* name, int error, const std::string& done, const std::string& not_done) {
  if (error == 0) return {name, true, done};
  return {name, false, not_done + " (" + std::strerror(error) + ")"};
}

// touches the stack's pages once, so that the loop never waits for one
[[gnu::noinline]] void touchStack() {
  volatile char room[kStackBytes];
  for (std::size_t i = 0; i < sizeof room; i += 1024) room[i] = 0;
}

}  // namespace

RtStep lockMemory() {
  const int error = ::mlockall(MCL_CURRENT | MCL_FUTURE) == 0 ? 0 : errno;
  return step("memory lock", error, "all memory stays in RAM",
              "memory may be swapped out; run as root, or raise the limit: ulimit -l unlimited");
}

std::vector<RtStep> makeThreadRealTime(int priority) {
  std::vector<RtStep> steps;
  sched_param parameters{};
  parameters.sched_priority = priority;
  steps.push_back(
      step("FIFO priority", ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters),
           "SCHED_FIFO at priority " + std::to_string(priority),
           "ordinary priority, ticks come late when the machine is busy; run as root, or raise the limit: "
           "ulimit -r 99"));
  steps.push_back(step("timer slack", ::prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL) == 0 ? 0 : errno, "1 ns",
                       "the system's 50 µs stay"));
  touchStack();
  steps.push_back({"stack", true, std::to_string(kStackBytes / 1024) + " KiB mapped beforehand"});
  return steps;
}

std::int64_t SteadyLoopClock::nowNs() noexcept {
  return steadyNowNs();
}

void SteadyLoopClock::sleepUntilNs(std::int64_t due_ns) noexcept {
  constexpr std::int64_t kSecond = 1'000'000'000;
  const timespec due{static_cast<std::time_t>(due_ns / kSecond), static_cast<long>(due_ns % kSecond)};
  // a signal may wake it early: the absolute time stays the same
  while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, nullptr) == EINTR) {
  }
}

}  // namespace needlelab
