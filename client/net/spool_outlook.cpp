#include "client/net/spool_outlook.h"

#include <algorithm>
#include <cmath>

#include "common/base/text.h"

namespace needlelab {

std::string sizeText(std::uint64_t bytes) {
  const auto size = static_cast<double>(bytes);
  if (bytes < 1024) return std::to_string(bytes) + " bytes";
  if (size < 0x1p20) return formatted("%.0f KiB", size / 0x1p10);
  if (size < 0x1p30) return formatted(size < 10 * 0x1p20 ? "%.1f MiB" : "%.0f MiB", size / 0x1p20);
  return formatted("%.1f GiB", size / 0x1p30);
}

std::string durationText(double hours) {
  if (hours < 2) return formatted("%.0f minutes", std::floor(hours * 60));
  if (hours < 72) return formatted("%.0f hours", std::floor(hours));
  if (hours < 24 * 365) return formatted("%.0f days", std::floor(hours / 24));
  return "years";
}

SpoolOutlook outlookOf(const SpoolUsage& usage, std::uint64_t quota_bytes, double rate_hz,
                       const SpoolThresholds& thresholds) {
  SpoolOutlook outlook;
  // a short lesson in which little moves says nothing of the next
  const double per_sample =
      usage.unsent_samples >= thresholds.enough_samples && usage.unsent_bytes > 0
          ? static_cast<double>(usage.unsent_bytes) / static_cast<double>(usage.unsent_samples)
          : thresholds.usual_bytes_per_sample;
  outlook.bytes_per_h = per_sample * rate_hz * 3600;
  const std::uint64_t quota_left = quota_bytes - std::min(quota_bytes, usage.unsent_bytes);
  outlook.quota_h = static_cast<double>(quota_left) / outlook.bytes_per_h;
  outlook.disk_h = static_cast<double>(usage.free_bytes) / outlook.bytes_per_h;

  // the quota bounds what waits for a server; while nothing waits, only the disk counts
  const bool waits = usage.unsent_bytes > 0;
  const bool over = waits && quota_left == 0;
  const double shortest = waits ? std::min(outlook.quota_h, outlook.disk_h) : outlook.disk_h;
  outlook.level = over || shortest < thresholds.urgent_h ? SpoolLevel::kUrgent
                  : shortest < thresholds.warn_h         ? SpoolLevel::kWarn
                  : waits                                ? SpoolLevel::kUnsent
                                                         : SpoolLevel::kGood;
  if (outlook.level == SpoolLevel::kGood) return outlook;

  std::string& words = outlook.words;
  if (waits) {
    words = "the spool holds " + sizeText(usage.unsent_bytes) + " in " +
            std::to_string(usage.unsent_sessions) + (usage.unsent_sessions == 1 ? " session" : " sessions") +
            " that no server has yet; ";
    if (over) words += "that is over its quota of " + sizeText(quota_bytes) + ", and kept nevertheless; ";
  }
  words += "at " + sizeText(static_cast<std::uint64_t>(outlook.bytes_per_h)) + " an hour ";
  if (waits && !over && outlook.quota_h <= outlook.disk_h)
    words += durationText(outlook.quota_h) + " of lessons fit into its quota of " + sizeText(quota_bytes);
  else
    words += durationText(outlook.disk_h) + " of lessons fit on its disk, which has " +
             sizeText(usage.free_bytes) + " left";
  if (outlook.level < SpoolLevel::kWarn) return outlook;
  const bool disk_is_short = outlook.disk_h < thresholds.warn_h;
  words += ": ";
  if (waits) words += "connect to the server";
  if (disk_is_short) words += std::string(waits ? ", and " : "") + "make room on that disk";
  if (waits && !disk_is_short) words += ", or raise --spool-quota";
  return outlook;
}

}  // namespace needlelab
