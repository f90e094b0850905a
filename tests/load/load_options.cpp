#include "tests/load/load_options.h"

#include <algorithm>
#include <cmath>

#include "common/base/range.h"

namespace needlelab::test {
namespace {

Status within(const char* option, double value, double min, double max) {
  const NumberRange range{min, max};
  if (range.contains(value)) return {};
  return outOfRange(option, value, range);
}

Error invalid(const std::string& text) {
  return {ErrorCode::kInvalidInput, text};
}

}  // namespace

Status checkOptions(const LoadOptions& options) {
  Status checks[] = {
      within("--stations", static_cast<double>(options.stations), 1, 4000),
      within("--viewers", static_cast<double>(options.viewers), 0, 100),
      within("--seconds", options.seconds, 0.1, 7200),
      within("--spread", options.spread_s, 0, 60),
      within("--gestures", static_cast<double>(options.gestures), 1, 500),
      within("--connect-rate", options.connect_per_s, 1, 10'000),
      within("--fault-every", options.fault_every_s, 0.5, 3600),
  };
  for (Status& check : checks)
    if (!check.ok()) return std::move(check);
  if (options.server && options.ca_file.empty())
    return invalid("--server needs --ca FILE: the server's tls/ca.crt");
  if (options.server && options.password_file.empty())
    return invalid(
        "--server needs --password-file FILE, the password of the administrator --user: the stations are "
        "enrolled and the database is read by him");
  if (options.server && !options.data.empty())
    return invalid("--data is the folder of an own server: it does not go with --server");
  if (options.server && !options.store.empty())
    return invalid("--store is the database of an own server: it does not go with --server");
  if (options.server && options.faults)
    return invalid("--faults kills and restarts an own server: it does not go with --server");
  if (!options.server && (!options.ca_file.empty() || !options.password_file.empty()))
    return invalid("--ca and --password-file go with --server HOST:PORT");
  return {};
}

FaultPlan::FaultPlan(const LoadOptions& options)
    : stations_(options.stations),
      viewers_(options.viewers),
      every_s_(options.fault_every_s),
      seconds_(options.seconds),
      random_(options.seed ^ 0xfa017) {
  planNext();
}

void FaultPlan::planNext() {
  // limited to a quarter and three times the mean, so that every run has faults, but not a storm of them
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
  if (number == 1 || (number > 1 && kind < 0.2 && time_s < kKillShare * seconds_)) {
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
