#include "tests/load/fault_plan.h"

#include <algorithm>
#include <cmath>

namespace needlelab::test {

FaultPlan::FaultPlan(const LoadOptions& options)
    : stations_(options.stations),
      viewers_(options.viewers),
      every_s_(options.fault_every_s),
      seconds_(options.seconds),
      random_(options.seed ^ 0xfa017) {
  planNext();
}

void FaultPlan::planNext() {
  // held to a quarter and three times the mean: no run without a fault, no storm of them
  next_s_ += every_s_ * std::clamp(-std::log(1 - random_.uniform()), 0.25, 3.0);
}

std::optional<PlannedFault> FaultPlan::at(double time_s) {
  if (time_s < next_s_) return std::nullopt;
  planNext();
  PlannedFault fault;
  const std::uint64_t number = count_++;
  const double kind = random_.uniform();
  const auto some = [&](std::size_t of) {
    std::vector<std::size_t> who;
    const std::size_t count = 1 + random_.next() % std::max<std::size_t>(1, of / 4);
    for (std::size_t i = 0; i < count; ++i) who.push_back(random_.next() % of);
    return who;
  };
  if (number == 1 || (number > 1 && kind < 0.2 && time_s < 0.5 * seconds_)) {
    fault.kind = PlannedFault::Kind::kKillServer;
    fault.time = std::chrono::milliseconds(random_.next() % 2000);
  } else if (number > 1 && kind < 0.5 && viewers_ > 0) {
    fault.kind = PlannedFault::Kind::kSlowViewer;
    fault.who = some(viewers_);
    fault.time = std::chrono::milliseconds(200 + random_.next() % 5000);
  } else {
    fault.who = some(stations_);
  }
  return fault;
}

}  // namespace needlelab::test
