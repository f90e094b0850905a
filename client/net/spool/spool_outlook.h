/// Estimates how long lessons can continue without a server, from the unsent recordings in the spool and the
/// free space; also as text.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "client/net/spool/spool.h"
#include "common/base/time/time_source.h"

namespace needlelab {

/// Thresholds for warnings, in hours of lessons at the present rate.
struct SpoolThresholds {
  double warn_h = 10;                 ///< below this in the quota or on the disk: a warning
  double urgent_h = 1;                ///< below this the instructor is notified as well
  double usual_bytes_per_sample = 8;  ///< upper estimate for a lesson
  std::uint64_t enough_samples =
      600'000;  ///< from this many unsent samples on, use the spool's own bytes per sample
};

enum class SpoolLevel : std::uint8_t {
  kGood,    ///< nothing to report
  kUnsent,  ///< unsent recordings, with room left
  kWarn,    ///< the quota or the disk is nearly used up
  kUrgent,  ///< over the quota, or hardly any room left
};

struct SpoolOutlook {
  double bytes_per_h = 0;
  double quota_h = 0;  ///< until unsent recordings alone fill the quota; 0: they already do
  double disk_h = 0;   ///< until the disk is full
  SpoolLevel level = SpoolLevel::kGood;
  std::string text;  ///< for a person; empty when all is good
};

/// Predicts from the spool's own bytes per sample, at this rate. Unsent recordings are never deleted, even
/// over the quota; then the text says so.
SpoolOutlook outlookOf(const SpoolUsage& usage, std::uint64_t quota_bytes, double rate_hz,
                       const SpoolThresholds& thresholds = {});

/// "3.1 GiB", "25 MiB", "800 KiB", "17 bytes".
std::string sizeText(std::uint64_t bytes);
/// "40 minutes", "12 hours", "60 days", "years".
std::string durationText(double hours);

/// Monitors the spool's space during a lesson: removes sessions that the server has, and warns in time.
/// Thread: one, the program's main thread.
class SpoolGuard {
 public:
  using Report = std::function<void(const std::string&)>;
  /// `spool` and `time` must outlive it.
  SpoolGuard(Spool& spool, SpoolKeep keep, double rate_hz, Report report, SpoolThresholds thresholds = {},
             TimeSource& time = machineTime())
      : spool_(spool),
        keep_(keep),
        rate_hz_(rate_hz),
        report_(std::move(report)),
        thresholds_(thresholds),
        time_(time) {}

  /// Reports the outlook unless it is good. Call at the start and end of a lesson.
  void report();
  /// Measures every 10 s, and reports a level worse than the last one reported. Call often.
  void check();
  /// Text for the status line; empty unless urgent.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }
  [[nodiscard]] const SpoolOutlook& outlook() const { return outlook_; }

 private:
  void measure();

  Spool& spool_;
  SpoolKeep keep_;
  double rate_hz_;
  Report report_;
  SpoolThresholds thresholds_;
  TimeSource& time_;
  SpoolOutlook outlook_;
  SpoolLevel reported_ = SpoolLevel::kUnsent;  // lower levels are not reported within a lesson
  std::string trouble_;
  std::int64_t next_check_ns_ = 0;
};

}  // namespace needlelab
