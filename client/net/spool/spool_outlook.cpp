#include "client/net/spool/spool_outlook.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace needlelab {
namespace {

constexpr std::int64_t kCheckEvery_ns = 10'000'000'000;

}  // namespace

std::string sizeText(std::uint64_t bytes) {
  const auto size = static_cast<double>(bytes);
  if (bytes < 1024) return fmt::format("{} bytes", bytes);
  if (size < 0x1p20) return fmt::format("{:.0f} KiB", size / 0x1p10);
  if (size < 0x1p30) return fmt::format("{:.{}f} MiB", size / 0x1p20, size < 10 * 0x1p20 ? 1 : 0);
  return fmt::format("{:.1f} GiB", size / 0x1p30);
}

std::string durationText(double hours) {
  if (hours < 2) return fmt::format("{:.0f} minutes", std::floor(hours * 60));
  if (hours < 72) return fmt::format("{:.0f} hours", std::floor(hours));
  if (hours < 24 * 365) return fmt::format("{:.0f} days", std::floor(hours / 24));
  return "years";
}

SpoolOutlook outlookOf(const SpoolUsage& usage, std::uint64_t quota_bytes, double rate_hz,
                       const SpoolThresholds& thresholds) {
  SpoolOutlook outlook;
  // a short lesson with little motion does not predict the next one
  const double per_sample =
      usage.unsent_samples >= thresholds.enough_samples && usage.unsent_bytes > 0
          ? static_cast<double>(usage.unsent_bytes) / static_cast<double>(usage.unsent_samples)
          : thresholds.usual_bytes_per_sample;
  outlook.bytes_per_h = per_sample * rate_hz * 3600;
  const std::uint64_t quota_left = quota_bytes - std::min(quota_bytes, usage.unsent_bytes);
  outlook.quota_h = static_cast<double>(quota_left) / outlook.bytes_per_h;
  outlook.disk_h = static_cast<double>(usage.free_bytes) / outlook.bytes_per_h;

  // the quota limits unsent recordings; without any, only the disk counts
  const bool waits = usage.unsent_bytes > 0;
  const bool over = waits && quota_left == 0;
  const double shortest = waits ? std::min(outlook.quota_h, outlook.disk_h) : outlook.disk_h;
  outlook.level = over || shortest < thresholds.urgent_h ? SpoolLevel::kUrgent
                  : shortest < thresholds.warn_h         ? SpoolLevel::kWarn
                  : waits                                ? SpoolLevel::kUnsent
                                                         : SpoolLevel::kGood;
  if (outlook.level == SpoolLevel::kGood) return outlook;

  std::string& text = outlook.text;
  if (waits) {
    text = fmt::format("the spool holds {} in {} {} that no server has yet; ", sizeText(usage.unsent_bytes),
                       usage.unsent_sessions, usage.unsent_sessions == 1 ? "session" : "sessions");
    if (over)
      text += fmt::format("that is over its quota of {}, and kept nevertheless; ", sizeText(quota_bytes));
  }
  text += fmt::format("at {} an hour ", sizeText(static_cast<std::uint64_t>(outlook.bytes_per_h)));
  if (waits && !over && outlook.quota_h <= outlook.disk_h)
    text += fmt::format("{} of lessons fit into its quota of {}", durationText(outlook.quota_h),
                        sizeText(quota_bytes));
  else
    text += fmt::format("{} of lessons fit on its disk, which has {} left", durationText(outlook.disk_h),
                        sizeText(usage.free_bytes));
  if (outlook.level < SpoolLevel::kWarn) return outlook;
  const bool disk_is_short = outlook.disk_h < thresholds.warn_h;
  text += ": ";
  if (waits) text += "connect to the server";
  if (disk_is_short) text += std::string(waits ? ", and " : "") + "make room on that disk";
  if (waits && !disk_is_short) text += ", or raise --spool-quota";
  return outlook;
}

void SpoolGuard::measure() {
  next_check_ns_ = time_.nowNs() + kCheckEvery_ns;
  // if the free space is unreadable, the writer reports it
  auto usage = spool_.usage();
  if (!usage.ok()) return;
  // during a lesson, remove closed sessions only when the disk needs their space
  if (usage->free_bytes < keep_.min_free_bytes) {
    for (const std::string& note : spool_.cleanUp(keep_)) report_(note);
    if (auto again = spool_.usage(); again.ok()) usage = again;
  }
  outlook_ = outlookOf(*usage, keep_.quota_bytes, rate_hz_, thresholds_);
  trouble_ = outlook_.level == SpoolLevel::kUrgent ? outlook_.text : std::string();
}

void SpoolGuard::report() {
  measure();
  if (outlook_.level != SpoolLevel::kGood) report_(outlook_.text);
  reported_ = std::max(SpoolLevel::kUnsent, outlook_.level);
}

void SpoolGuard::check() {
  if (time_.nowNs() < next_check_ns_) return;
  measure();
  if (outlook_.level > reported_) report_(outlook_.text);
  reported_ = std::max(SpoolLevel::kUnsent, outlook_.level);
}

}  // namespace needlelab
