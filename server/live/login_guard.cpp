#include "server/live/login_guard.h"

#include <fmt/core.h>
#include <algorithm>
#include <cmath>

#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr std::int64_t kNsPerMs = 1'000'000;

/// Of a name with the kind of account before it ("person ", "station ").
constexpr std::size_t kMostBytes = kMaxNameBytes + 16;

/// Nobody has a longer name; kept as it is, each would hold what somebody sent.
const std::string& nameKey(const std::string& name) {
  return LoginGuard::countedName(name);
}

/// Includes the lengths, so that different pairs of name and address always have different keys.
std::string pairKey(const std::string& name, const std::string& address) {
  const std::string& key = nameKey(name);
  return fmt::format("{} {} {}", key.size(), key, address);
}

}  // namespace

const std::string& LoginGuard::countedName(const std::string& name) {
  static const std::string too_long(kMostBytes + 1, '?');
  return name.size() > kMostBytes ? too_long : name;
}

LoginGuard::Entries LoginGuard::*LoginGuard::tableOf(Kind kind) {
  switch (kind) {
    case Kind::kKnown:
      return &LoginGuard::known_;
    case Kind::kKnownAddress:
      return &LoginGuard::known_addresses_;
    case Kind::kName:
      return &LoginGuard::names_;
    case Kind::kAddress:
      return &LoginGuard::addresses_;
    case Kind::kPair:
    case Kind::kCode:
      break;
  }
  return &LoginGuard::pairs_;
}

std::string LoginGuard::keyOf(Kind kind, const std::string& name, const std::string& address) {
  if (kind == Kind::kName) return nameKey(name);
  return kind == Kind::kAddress || kind == Kind::kKnownAddress ? address : pairKey(name, address);
}

std::optional<LoginGuard::Entry> LoginGuard::entry(Kind kind, const std::string& name,
                                                   const std::string& address) const {
  const Entries& table = this->*tableOf(kind);
  const auto found = table.find(keyOf(kind, name, address));
  return found == table.end() ? std::nullopt : std::optional(found->second);
}

void LoginGuard::setEntry(Kind kind, const std::string& name, const std::string& address,
                          const Entry& entry) {
  (this->*tableOf(kind))[keyOf(kind, name, address)] = entry;
}

double LoginGuard::leftAfter(const Entry& entry, Milliseconds refill, std::int64_t now_ns) {
  const double leaked =
      static_cast<double>(now_ns - entry.at_ns) / (1e6 * static_cast<double>(refill.count()));
  return std::max(0.0, entry.failures - leaked);
}

LoginGuard::Milliseconds LoginGuard::waitOf(const Entries& entries, const std::string& key, double allowed,
                                            Milliseconds refill, std::int64_t now_ns) {
  const auto found = entries.find(key);
  if (found == entries.end()) return Milliseconds(0);
  const double above = leftAfter(found->second, refill, now_ns) - (allowed - 1);
  if (above <= 0) return Milliseconds(0);
  return Milliseconds(
      static_cast<std::int64_t>(std::ceil(above * static_cast<double>(refill.count()) - 1e-3)));
}

LoginGuard::Milliseconds LoginGuard::waitOfPair(const std::string& key, std::int64_t now_ns) const {
  const auto found = pairs_.find(key);
  if (found == pairs_.end()) return Milliseconds(0);
  const double above = found->second.failures - settings_.allowed_per_name;
  if (above < 0) return Milliseconds(0);
  const double wait_ms = std::min(static_cast<double>(settings_.first_wait.count()) * std::exp2(above),
                                  static_cast<double>(settings_.longest_wait.count()));
  const double left_ms =
      wait_ms - static_cast<double>(now_ns - found->second.at_ns) / static_cast<double>(kNsPerMs);
  return Milliseconds(static_cast<std::int64_t>(std::ceil(std::max(0.0, left_ms))));
}

LoginGuard::Milliseconds LoginGuard::mustWait(const std::string& name, const std::string& address,
                                              std::int64_t now_ns) const {
  const Milliseconds own = waitOfPair(pairKey(name, address), now_ns);
  if (knows(name, address)) return own;
  return std::max(
      {own, waitOf(names_, nameKey(name), settings_.allowed_everywhere, settings_.refill_everywhere, now_ns),
       waitOf(addresses_, address, settings_.allowed_per_address, settings_.refill_address, now_ns)});
}

bool LoginGuard::failed(const std::string& name, const std::string& address, std::int64_t now_ns) {
  const bool waited = mustWait(name, address, now_ns).count() > 0;
  Entry& pair = entryOf(pairs_, pairKey(name, address));
  if (now_ns - pair.at_ns > settings_.quiet.count() * kNsPerMs) pair.failures = 0;
  pair.failures += 1;
  pair.at_ns = now_ns;
  // typing errors of a known person do not count against the lab's address
  if (!knows(name, address)) {
    count(names_, nameKey(name), settings_.refill_everywhere, now_ns);
    count(addresses_, address, settings_.refill_address, now_ns);
  }
  return !waited && mustWait(name, address, now_ns).count() > 0;
}

void LoginGuard::succeeded(const std::string& name, const std::string& address, std::int64_t now_ns) {
  const std::string key = pairKey(name, address);
  pairs_.erase(key);
  entryOf(known_, key).at_ns = now_ns;
  entryOf(known_addresses_, address).at_ns = now_ns;
}

bool LoginGuard::knows(const std::string& name, const std::string& address) const {
  return known_.contains(pairKey(name, address));
}

bool LoginGuard::knowsAddress(const std::string& address) const {
  return known_addresses_.contains(address);
}

LoginGuard::Entry& LoginGuard::entryOf(Entries& entries, const std::string& key) const {
  if (entries.size() >= settings_.max_entries && !entries.contains(key)) {
    // remove only one entry: otherwise an attacker who fills the table would clear it
    entries.erase(std::min_element(entries.begin(), entries.end(), [](const auto& a, const auto& b) {
      return a.second.at_ns < b.second.at_ns;
    }));
  }
  return entries[key];
}

void LoginGuard::count(Entries& entries, const std::string& key, Milliseconds refill,
                       std::int64_t now_ns) const {
  Entry& entry = entryOf(entries, key);
  entry.failures = leftAfter(entry, refill, now_ns) + 1;
  entry.at_ns = now_ns;
}

}  // namespace needlelab
