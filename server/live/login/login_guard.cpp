#include "server/live/login/login_guard.h"

#include <fmt/core.h>
#include <algorithm>
#include <cmath>

#include "common/base/text/text.h"

namespace needlelab {
namespace {

using Kind = LoginGuard::Kind;

constexpr double kNsPerMs = 1e6;

/// Of a name prefixed with the kind of account ("person ", "station ").
constexpr std::size_t kMostBytes = kMaxNameBytes + 16;

std::string keyOf(Kind kind, const std::string& name, const std::string& address) {
  const std::string& key = LoginGuard::countedName(name);
  if (kind == Kind::kName) return key;
  if (kind == Kind::kAddress || kind == Kind::kKnownAddress) return address;
  // include the length, so that different pairs of name and address always have different keys
  return fmt::format("{} {} {}", key.size(), key, address);
}

std::size_t indexOf(Kind kind) {
  return static_cast<std::size_t>(kind);
}

}  // namespace

const std::string& LoginGuard::countedName(const std::string& name) {
  // no account has a longer name; without this, each would keep what a stranger sent
  static const std::string too_long(kMostBytes + 1, '?');
  return name.size() > kMostBytes ? too_long : name;
}

std::optional<LoginGuard::Entry> LoginGuard::entry(Kind kind, const std::string& name,
                                                   const std::string& address) const {
  const Entries& table = tables_[indexOf(kind)];
  const auto found = table.find(keyOf(kind, name, address));
  return found == table.end() ? std::nullopt : std::optional(found->second);
}

void LoginGuard::setEntry(Kind kind, const std::string& name, const std::string& address,
                          const Entry& entry) {
  tables_[indexOf(kind)][keyOf(kind, name, address)] = entry;
}

std::size_t LoginGuard::entries() const {
  std::size_t count = 0;
  for (const Entries& table : tables_) count += table.size();
  return count;
}

TokenBucket LoginGuard::bucket(Kind kind, const std::string& name, const std::string& address) const {
  const bool of_name = kind == Kind::kName;
  const Milliseconds refill = of_name ? settings_.refill_everywhere : settings_.refill_address;
  const Entry known = entry(kind, name, address).value_or(Entry{});
  return {{of_name ? settings_.allowed_everywhere : settings_.allowed_per_address,
           1000 / static_cast<double>(refill.count())},
          known.failures,
          known.at_ns};
}

LoginGuard::Milliseconds LoginGuard::waitOfPair(const std::string& name, const std::string& address,
                                                std::int64_t now_ns) const {
  const Entry pair = entry(Kind::kPair, name, address).value_or(Entry{});
  const double above = pair.failures - settings_.allowed_per_name;
  if (above < 0) return Milliseconds(0);
  const double wait_ms = std::min(static_cast<double>(settings_.first_wait.count()) * std::exp2(above),
                                  static_cast<double>(settings_.longest_wait.count()));
  const double left_ms = wait_ms - static_cast<double>(now_ns - pair.at_ns) / kNsPerMs;
  return Milliseconds(static_cast<std::int64_t>(std::ceil(std::max(0.0, left_ms))));
}

LoginGuard::Milliseconds LoginGuard::mustWait(const std::string& name, const std::string& address,
                                              std::int64_t now_ns) const {
  Milliseconds wait = waitOfPair(name, address, now_ns);
  if (knows(name, address)) return wait;
  for (const Kind kind : {Kind::kName, Kind::kAddress}) {
    const double left_ms = 1000 * bucket(kind, name, address).secondsUntil(1, now_ns);
    wait = std::max(wait, Milliseconds(static_cast<std::int64_t>(std::ceil(left_ms - 1e-3))));
  }
  return wait;
}

bool LoginGuard::failed(const std::string& name, const std::string& address, std::int64_t now_ns) {
  const bool waited = mustWait(name, address, now_ns).count() > 0;
  Entry& pair = entryOf(Kind::kPair, name, address);
  if (now_ns - pair.at_ns > std::chrono::nanoseconds(settings_.quiet).count()) pair.failures = 0;
  pair.failures += 1;
  pair.at_ns = now_ns;
  // typing errors of a person known here do not count against the lab's address
  if (!knows(name, address)) {
    for (const Kind kind : {Kind::kName, Kind::kAddress}) {
      TokenBucket failures = bucket(kind, name, address);
      failures.take(1, now_ns);
      entryOf(kind, name, address) = {failures.used, failures.at_ns};
    }
  }
  return !waited && mustWait(name, address, now_ns).count() > 0;
}

void LoginGuard::takeBack(const std::string& name, const std::string& address, const Entry& pair,
                          std::int64_t now_ns) {
  const auto put = [&](Kind kind, const Entry& entry) {
    if (entry.failures > 0)
      setEntry(kind, name, address, entry);
    else
      tables_[indexOf(kind)].erase(keyOf(kind, name, address));
  };
  if (auto now = entry(Kind::kPair, name, address)) {
    now->failures -= 1;
    put(Kind::kPair, now->failures == pair.failures ? pair : *now);
  }
  if (knows(name, address)) return;
  for (const Kind kind : {Kind::kName, Kind::kAddress}) {
    TokenBucket failures = bucket(kind, name, address);
    failures.take(-1, now_ns);
    put(kind, {failures.used, failures.at_ns});
  }
}

void LoginGuard::succeeded(const std::string& name, const std::string& address, std::int64_t now_ns) {
  tables_[indexOf(Kind::kPair)].erase(keyOf(Kind::kPair, name, address));
  entryOf(Kind::kKnown, name, address).at_ns = now_ns;
  entryOf(Kind::kKnownAddress, name, address).at_ns = now_ns;
}

bool LoginGuard::knows(const std::string& name, const std::string& address) const {
  return entry(Kind::kKnown, name, address).has_value();
}

bool LoginGuard::knowsAddress(const std::string& address) const {
  return entry(Kind::kKnownAddress, {}, address).has_value();
}

LoginGuard::Entry& LoginGuard::entryOf(Kind kind, const std::string& name, const std::string& address) {
  Entries& entries = tables_[indexOf(kind)];
  const std::string key = keyOf(kind, name, address);
  if (entries.size() >= settings_.max_entries && !entries.contains(key)) {
    // remove only one entry: otherwise an attacker who fills the table would clear it
    entries.erase(std::min_element(entries.begin(), entries.end(), [](const auto& a, const auto& b) {
      return a.second.at_ns < b.second.at_ns;
    }));
  }
  return entries[key];
}

}  // namespace needlelab
