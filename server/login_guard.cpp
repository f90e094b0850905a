#include "server/login_guard.h"

#include <algorithm>
#include <cmath>

namespace needlelab {

double LoginGuard::leftAfter(const Entry& entry, std::chrono::milliseconds refill, std::int64_t now_ns) {
  const double leaked =
      static_cast<double>(now_ns - entry.at_ns) / (1e6 * static_cast<double>(refill.count()));
  return std::max(0.0, entry.failures - leaked);
}

std::chrono::milliseconds LoginGuard::waitOf(const Entries& entries, const std::string& key, double allowed,
                                             std::chrono::milliseconds refill, std::int64_t now_ns) {
  const auto found = entries.find(key);
  if (found == entries.end()) return std::chrono::milliseconds(0);
  const double above = leftAfter(found->second, refill, now_ns) - (allowed - 1);
  if (above <= 0) return std::chrono::milliseconds(0);
  return std::chrono::milliseconds(
      static_cast<std::int64_t>(std::ceil(above * static_cast<double>(refill.count()) - 1e-3)));
}

std::chrono::milliseconds LoginGuard::mustWait(const std::string& name, const std::string& address,
                                               std::int64_t now_ns) const {
  return std::max(
      waitOf(names_, name, settings_.allowed_per_name, settings_.refill_name, now_ns),
      waitOf(addresses_, address, settings_.allowed_per_address, settings_.refill_address, now_ns));
}

void LoginGuard::failed(const std::string& name, const std::string& address, std::int64_t now_ns) {
  count(names_, name, settings_.refill_name, now_ns);
  count(addresses_, address, settings_.refill_address, now_ns);
}

void LoginGuard::count(Entries& entries, const std::string& key, std::chrono::milliseconds refill,
                       std::int64_t now_ns) const {
  if (entries.size() >= settings_.max_entries && !entries.contains(key)) {
    std::erase_if(entries, [&](const auto& entry) { return leftAfter(entry.second, refill, now_ns) <= 0; });
    if (entries.size() >= settings_.max_entries) entries.clear();
  }
  Entry& entry = entries[key];
  entry.failures = leftAfter(entry, refill, now_ns) + 1;
  entry.at_ns = now_ns;
}

}  // namespace needlelab
