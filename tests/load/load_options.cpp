#include "tests/load/load_options.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "common/base/range.h"
#include "db/store/store_address.h"

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

// they become `server join --name`, --live-name, and folder names
Status checkNames(const std::vector<std::string>& names) {
  const std::string wanted = fmt::format("--servers: names of 2 to {} servers, such as a,b", kMaxServers);
  if (names.size() < 2 || names.size() > kMaxServers)
    return invalid(fmt::format("{}; here are {}", wanted, names.size()));
  for (const std::string& name : names) {
    const bool is_name = !name.empty() && name.size() <= 20 &&
                         std::all_of(name.begin(), name.end(),
                                     [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'); });
    if (!is_name || name == kFirstServer)
      return invalid(fmt::format("{}: small letters and digits, at most 20, and not '{}'; here is '{}'",
                                 wanted, kFirstServer, name));
  }
  if (std::set<std::string>(names.begin(), names.end()).size() < names.size())
    return invalid(wanted + ": each has a name of its own");
  return {};
}

}  // namespace

std::size_t firstServerOf(std::size_t station, std::size_t viewers, std::size_t servers) {
  const std::size_t turns = std::max<std::size_t>(viewers, 1);
  return (station / turns + station % turns) % std::max<std::size_t>(servers, 1);
}

Status checkOptions(const LoadOptions& options) {
  RETURN_IF_ERROR(within("--stations", static_cast<double>(options.stations), 1, 4000));
  RETURN_IF_ERROR(within("--viewers", static_cast<double>(options.viewers), 0, 100));
  RETURN_IF_ERROR(within("--seconds", options.seconds, 0.1, 7200));
  const bool here = options.server.empty(), several = !options.servers.empty(),
             store = !options.store.empty();
  const struct {
    bool wrong;
    const char* text;
  } rules[] = {
      {!here && options.ca_file.empty(), "--server needs --ca FILE: the server's tls/ca.crt"},
      {!here && options.password_file.empty(),
       "--server needs --password-file FILE, the password of the administrator --user: the stations are "
       "enrolled and the database is read by him"},
      {here && (!options.ca_file.empty() || !options.password_file.empty()),
       "--ca and --password-file go with --server HOST:PORT"},
      {!here && (store || several || options.faults),
       "--store, --servers and --faults are of own servers: they do not go with --server"},
      {several && !store, "--servers work together on a database on PostgreSQL: give it by --store URL"},
      {several && options.faults,
       "--faults has one server: several are attacked by tests/faculty, leave --servers out"},
      {!options.standby.empty() && !store, "--standby is that of the database of --store: give both"},
  };
  for (const auto& rule : rules)
    if (rule.wrong) return invalid(rule.text);
  if (several) return checkNames(options.servers);
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
  // clamped between a quarter and three times the mean, so that every run has faults, but not a storm of them
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
