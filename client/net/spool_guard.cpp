#include "client/net/spool_guard.h"

#include <algorithm>

#include "common/base/clock.h"

namespace needlelab {
namespace {

constexpr std::int64_t kLookEvery_ns = 10'000'000'000;

}  // namespace

void SpoolGuard::measure() {
  next_look_ns_ = steadyNowNs() + kLookEvery_ns;
  // a disk that cannot be asked is told of by who writes to it
  auto usage = spool_.usage();
  if (!usage.ok()) return;
  // closed sessions leave while the lesson runs only when the disk needs their room
  if (usage->free_bytes < keep_.min_free_bytes) {
    for (const std::string& note : spool_.cleanUp(keep_, wallNowNs())) say_(note);
    if (auto again = spool_.usage(); again.ok()) usage = again;
  }
  outlook_ = outlookOf(*usage, keep_.quota_bytes, rate_hz_, thresholds_);
  trouble_ = outlook_.level == SpoolLevel::kUrgent ? outlook_.words : std::string();
}

void SpoolGuard::report() {
  measure();
  if (outlook_.level != SpoolLevel::kGood) say_(outlook_.words);
  said_ = std::max(SpoolLevel::kUnsent, outlook_.level);
}

void SpoolGuard::look() {
  if (steadyNowNs() < next_look_ns_) return;
  measure();
  if (outlook_.level > said_) say_(outlook_.words);
  said_ = std::max(SpoolLevel::kUnsent, outlook_.level);
}

}  // namespace needlelab
