#include "client/station/run/rt_thread.h"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>

#include "common/base/clock.h"
#include "common/base/text.h"

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

// "0-3, 6" of the cores that this process may use
std::string allowedCores(const cpu_set_t& set) {
  std::string text;
  for (int core = 0; core < CPU_SETSIZE; ++core) {
    if (!CPU_ISSET(core, &set)) continue;
    int last = core;
    while (last + 1 < CPU_SETSIZE && CPU_ISSET(last + 1, &set)) ++last;
    text += (text.empty() ? "" : ", ") + std::to_string(core);
    if (last > core) text += "-" + std::to_string(last);
    core = last;
  }
  return text;
}

RtStep stayOn(int core) {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  ::pthread_getaffinity_np(::pthread_self(), sizeof allowed, &allowed);
  const std::string number = std::to_string(core);
  if (core < 0 || core >= CPU_SETSIZE || !CPU_ISSET(core, &allowed))
    return {"core", false,
            "core " + number + " is not there or not for this process, which may use " +
                allowedCores(allowed) + "; the system chooses one"};
  cpu_set_t wanted;
  CPU_ZERO(&wanted);
  CPU_SET(core, &wanted);
  return step("core", ::pthread_setaffinity_np(::pthread_self(), sizeof wanted, &wanted),
              "the haptic thread stays on core " + number + "; others may still run there",
              "the haptic thread cannot be kept on core " + number + "; the system chooses one");
}

RtStep spinStep(const RtOptions& options) {
  // at most one wake-up a tick, so at most the spin's share of the period
  const double share = static_cast<double>(options.spin_ns) * 1e-9 * options.rate_hz;
  return {
      "spin", share < 0.9,
      formatted("the last %.0f µs before each tick are spent watching the clock: about %.0f %% of a core%s",
                static_cast<double>(options.spin_ns) * 1e-3, 100 * std::min(share, 1.0),
                share < 0.9 ? "" : ", which leaves nothing for sleep at this rate")};
}

void restShortly() noexcept {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#endif
}

}  // namespace

RtStep lockMemory() {
  const int error = ::mlockall(MCL_CURRENT | MCL_FUTURE) == 0 ? 0 : errno;
  return step("memory lock", error, "all memory stays in RAM",
              "memory may be swapped out; run as root, or raise the limit: ulimit -l unlimited");
}

std::vector<RtStep> makeThreadRealTime(int priority) {
  RtOptions options;
  options.priority = priority;
  return makeThreadRealTime(options);
}

std::vector<RtStep> makeThreadRealTime(const RtOptions& options) {
  std::vector<RtStep> steps;
  sched_param parameters{};
  parameters.sched_priority = options.priority;
  steps.push_back(
      step("FIFO priority", ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters),
           "SCHED_FIFO at priority " + std::to_string(options.priority),
           "ordinary priority, ticks come late when the machine is busy; run as root, or raise the limit: "
           "ulimit -r 99"));
  steps.push_back(step("timer slack", ::prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL) == 0 ? 0 : errno, "1 ns",
                       "the system's 50 µs stay"));
  touchStack();
  steps.push_back({"stack", true, std::to_string(kStackBytes / 1024) + " KiB mapped beforehand"});
  const bool fifo = steps.front().ok;
  if (options.cpu && (fifo || !options.cpu_needs_fifo)) steps.push_back(stayOn(*options.cpu));
  if (options.spin_ns > 0) steps.push_back(spinStep(options));
  return steps;
}

std::vector<std::string> rtStepLines(const std::vector<RtStep>& steps) {
  std::vector<std::string> lines;
  std::string done;
  for (const RtStep& step : steps)
    if (step.ok)
      done += (done.empty() ? "" : ", ") + step.name;
    else
      lines.push_back(step.name + ": " + step.message);
  if (!done.empty()) lines.insert(lines.begin(), done + ": done");
  return lines;
}

std::int64_t SteadyLoopClock::nowNs() noexcept {
  return steadyNowNs();
}

void SteadyLoopClock::sleepUntilNs(std::int64_t due_ns) noexcept {
  constexpr std::int64_t kSecond = 1'000'000'000;
  const std::int64_t wake_ns = due_ns - spin_ns_;
  const timespec wake{static_cast<std::time_t>(wake_ns / kSecond), static_cast<long>(wake_ns % kSecond)};
  // a signal may wake it early: the absolute time stays the same
  while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr) == EINTR) {
  }
  if (spin_ns_ > 0)
    while (steadyNowNs() < due_ns) restShortly();
}

}  // namespace needlelab
