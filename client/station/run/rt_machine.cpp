#include "client/station/run/rt_machine.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <optional>
#include <set>

#include "common/base/text.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;

template <typename T>
std::optional<T> readOne(const fs::path& file) {
  std::ifstream in(file);
  T value{};
  if (!(in >> value)) return std::nullopt;
  return value;
}

// the kernel takes FIFO threads off a core for the rest of each period once they used their share of it
std::optional<RtStep> throttling(const RtOptions& options, const fs::path& root) {
  const auto runtime_us = readOne<std::int64_t>(root / "proc/sys/kernel/sched_rt_runtime_us");
  const auto period_us = readOne<std::int64_t>(root / "proc/sys/kernel/sched_rt_period_us");
  if (!runtime_us || !period_us || *period_us <= 0) return std::nullopt;
  if (*runtime_us < 0) return RtStep{"FIFO share", true, "the system sets no limit to FIFO threads"};
  const double limit = static_cast<double>(*runtime_us) / static_cast<double>(*period_us);
  const double spin = static_cast<double>(options.spin_ns) * 1e-9 * options.rate_hz;
  constexpr double kWork = 0.1;  // what the ticks themselves may need, generously
  const std::string words = formatted("FIFO threads may use %.0f %% of a core", 100 * limit);
  if (spin + kWork < limit) return RtStep{"FIFO share", true, words + ", more than the loop needs"};
  return RtStep{"FIFO share", false,
                words + formatted(", and the spin alone takes %.0f %%: the system will stop the loop now and "
                                  "then; spin less, or sysctl kernel.sched_rt_runtime_us=-1",
                                  100 * spin)};
}

// of the loop's core, or of all of them
std::optional<RtStep> governor(const RtOptions& options, const fs::path& root) {
  std::set<std::string> found;
  std::error_code error;
  for (auto at = fs::directory_iterator(root / "sys/devices/system/cpu", error); !error && at != fs::end(at);
       at.increment(error)) {
    if (options.cpu && at->path().filename() != "cpu" + std::to_string(*options.cpu)) continue;
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

}  // namespace

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

}  // namespace needlelab
