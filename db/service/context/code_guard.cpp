#include "db/service/context/code_guard.h"

#include <fmt/core.h>

#include <algorithm>

namespace needlelab {
namespace {

constexpr std::int64_t kNsPerS = 1'000'000'000;

}  // namespace

CodeGuard::Try CodeGuard::begin(const std::string& name) {
  const std::lock_guard lock(mutex_);
  const std::int64_t now_ns = time_.nowNs();
  if (entries_.size() >= settings_.max_entries && !entries_.contains(name)) {
    entries_.erase(std::min_element(entries_.begin(), entries_.end(), [](const auto& a, const auto& b) {
      return a.second.at_ns < b.second.at_ns;
    }));
  }
  Entry& entry = entries_[name];
  Try begun;
  if (const std::int64_t left_ns = entry.wait_until_ns - now_ns; left_ns > 0) {
    begun.must_wait = std::chrono::seconds((left_ns + kNsPerS - 1) / kNsPerS);
    return begun;
  }
  ++entry.wrong;
  entry.at_ns = now_ns;
  if (entry.wrong < settings_.allowed) {
    begun.left = settings_.allowed - entry.wrong;
    return begun;
  }
  begun.then_wait = settings_.first_wait;
  for (unsigned i = settings_.allowed; i < entry.wrong && begun.then_wait < settings_.longest_wait; ++i)
    begun.then_wait *= 2;
  begun.then_wait = std::min(begun.then_wait, settings_.longest_wait);
  entry.wait_until_ns = now_ns + begun.then_wait.count() * kNsPerS;
  return begun;
}

void CodeGuard::forget(const std::string& name) {
  const std::lock_guard lock(mutex_);
  entries_.erase(name);
}

void CodeGuard::giveBack(const std::string& name) {
  const std::lock_guard lock(mutex_);
  const auto entry = entries_.find(name);
  if (entry == entries_.end() || entry->second.wrong == 0) return;
  --entry->second.wrong;
  entry->second.wait_until_ns = 0;  // no wait was left when the try was allowed
}

std::optional<CodeGuard::Entry> CodeGuard::entry(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(name);
  return found == entries_.end() ? std::nullopt : std::optional(found->second);
}

void CodeGuard::setEntry(const std::string& name, const Entry& entry) {
  const std::lock_guard lock(mutex_);
  entries_[name] = entry;
}

std::size_t CodeGuard::entries() const {
  const std::lock_guard lock(mutex_);
  return entries_.size();
}

std::string waitText(std::chrono::seconds wait) {
  return wait < std::chrono::seconds(60) ? fmt::format("{} s", wait.count())
                                         : fmt::format("{} min", (wait.count() + 59) / 60);
}

}  // namespace needlelab
