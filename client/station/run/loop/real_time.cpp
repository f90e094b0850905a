#include "client/station/run/loop/real_time.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <fstream>
#include <optional>
#include <set>

namespace needlelab {
namespace {

constexpr std::size_t kStackBytes = 256 * 1024;  // more than the loop ever uses

RtStep step(const char* name, int error, const std::string& done, const std::string& not_done) {
  if (error == 0) return {name, true, done};
  return {name, false, not_done + " (" + std::strerror(error) + ")"};
}

// touches the stack's pages once, so that the loop has no page faults
[[gnu::noinline]] void touchStack() {
  volatile char room[kStackBytes];
  for (std::size_t i = 0; i < sizeof room; i += 1024) room[i] = 0;
}

// the cores that this process may use, e.g. "0-3, 6"
std::string allowedCores(const cpu_set_t& set) {
  std::string text;
  for (int core = 0; core < CPU_SETSIZE; ++core) {
    if (!CPU_ISSET(core, &set)) continue;
    int last = core;
    while (last + 1 < CPU_SETSIZE && CPU_ISSET(last + 1, &set)) ++last;
    text += fmt::format("{}{}", text.empty() ? "" : ", ", core);
    if (last > core) text += fmt::format("-{}", last);
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
  // at most one wake-up per tick, so at most the spin's fraction of the period
  const double share = static_cast<double>(options.spin_ns) * 1e-9 * options.rate_hz;
  return {"spin", share < 0.9,
          fmt::format(
              "the last {:.0f} µs before each tick are spent watching the clock: about {:.0f} % of a core{}",
              static_cast<double>(options.spin_ns) * 1e-3, 100 * std::min(share, 1.0),
              share < 0.9 ? "" : ", which leaves nothing for sleep at this rate")};
}

void cpuRelax() noexcept {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#endif
}

namespace fs = std::filesystem;

template <typename T>
std::optional<T> readOne(const fs::path& file) {
  std::ifstream in(file);
  T value{};
  if (!(in >> value)) return std::nullopt;
  return value;
}

// the kernel throttles FIFO threads for the rest of each period after they used their share of it
std::optional<RtStep> throttling(const RtOptions& options, const fs::path& root) {
  const auto runtime_us = readOne<std::int64_t>(root / "proc/sys/kernel/sched_rt_runtime_us");
  const auto period_us = readOne<std::int64_t>(root / "proc/sys/kernel/sched_rt_period_us");
  if (!runtime_us || !period_us || *period_us <= 0) return std::nullopt;
  if (*runtime_us < 0) return RtStep{"FIFO share", true, "the system sets no limit to FIFO threads"};
  const double limit = static_cast<double>(*runtime_us) / static_cast<double>(*period_us);
  const double spin = static_cast<double>(options.spin_ns) * 1e-9 * options.rate_hz;
  constexpr double kWork = 0.1;  // generous estimate of the ticks' share
  const std::string limit_text = fmt::format("FIFO threads may use {:.0f} % of a core", 100 * limit);
  if (spin + kWork < limit) return RtStep{"FIFO share", true, limit_text + ", more than the loop needs"};
  return RtStep{
      "FIFO share", false,
      limit_text + fmt::format(", and the spin alone takes {:.0f} %: the system will stop the loop now and "
                               "then; spin less, or sysctl kernel.sched_rt_runtime_us=-1",
                               100 * spin)};
}

// for the loop's core, or for all cores
std::optional<RtStep> governor(const RtOptions& options, const fs::path& root) {
  std::set<std::string> found;
  std::error_code error;
  for (auto at = fs::directory_iterator(root / "sys/devices/system/cpu", error); !error && at != fs::end(at);
       at.increment(error)) {
    if (options.cpu && at->path().filename() != fmt::format("cpu{}", *options.cpu)) continue;
    if (const auto name = readOne<std::string>(at->path() / "cpufreq/scaling_governor")) found.insert(*name);
  }
  if (found.empty()) return std::nullopt;
  std::string names;
  for (const std::string& name : found) names += (names.empty() ? "" : ", ") + name;
  if (found == std::set<std::string>{"performance"})
    return RtStep{"clock governor", true, "performance: the cores keep their speed"};
  return RtStep{"clock governor", false,
                names +
                    ": a core that was idle runs slowly at first, ticks begin and end later; cpupower "
                    "frequency-set -g performance"};
}

// the cores that the calling thread may use; empty if the system does not report them
cpu_set_t coresOfThisThread() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  if (::pthread_getaffinity_np(::pthread_self(), sizeof cores, &cores) != 0) CPU_ZERO(&cores);
  return cores;
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
           fmt::format("SCHED_FIFO at priority {}", options.priority),
           "ordinary priority, ticks come late when the machine is busy; run as root, or raise the limit: "
           "ulimit -r 99"));
  steps.push_back(step("timer slack", ::prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL) == 0 ? 0 : errno, "1 ns",
                       "the system's 50 µs stay"));
  touchStack();
  steps.push_back({"stack", true, fmt::format("{} KiB mapped beforehand", kStackBytes / 1024)});
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

void LoopTime::sleepUntilNs(std::int64_t due_ns) noexcept {
  MachineTime::sleepUntilNs(due_ns - spin_ns_);
  if (spin_ns_ > 0)
    while (nowNs() < due_ns) cpuRelax();
}

ShallowSleep::ShallowSleep(const fs::path& file) {
  step_.name = "idle states";
  file_ = ::open(file.c_str(), O_RDWR | O_CLOEXEC);
  const std::int32_t none_us = 0;
  if (file_ >= 0 && ::write(file_, &none_us, sizeof none_us) == sizeof none_us) {
    step_.ok = true;
    step_.message = "the cores stay out of deep sleep during the lesson";
    return;
  }
  step_.message =
      "the cores may sleep deeply between ticks and wake late; run as root, or let the station's user "
      "write to " +
      file.string() + " (" + std::strerror(errno) + ")";
  if (file_ >= 0) ::close(file_);
  file_ = -1;
}

ShallowSleep::~ShallowSleep() {
  if (file_ >= 0) ::close(file_);
}

std::vector<RtStep> judgeMachine(const RtOptions& options, const fs::path& root) {
  std::vector<RtStep> steps;
  for (auto step : {throttling(options, root), governor(options, root)})
    if (step) steps.push_back(*step);
  return steps;
}

std::optional<int> coreForLoop(std::optional<int> wanted) {
  if (wanted) return wanted;
  const cpu_set_t cores = coresOfThisThread();
  if (CPU_COUNT(&cores) < 2) return std::nullopt;
  int last = CPU_SETSIZE - 1;
  while (!CPU_ISSET(last, &cores)) --last;
  return last;
}

KeepOffCore::KeepOffCore(std::optional<int> core) : before_(coresOfThisThread()) {
  if (!core || *core < 0 || *core >= CPU_SETSIZE || !CPU_ISSET(*core, &before_)) return;
  cpu_set_t others = before_;
  CPU_CLR(*core, &others);
  if (CPU_COUNT(&others) == 0) return;
  narrowed_ = ::pthread_setaffinity_np(::pthread_self(), sizeof others, &others) == 0;
}

KeepOffCore::~KeepOffCore() {
  if (narrowed_) ::pthread_setaffinity_np(::pthread_self(), sizeof before_, &before_);
}

}  // namespace needlelab
