/// How long lessons can go on without a server, by the unsent recordings in the spool and the free space, as
/// text.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "client/net/spool.h"

namespace needlelab {

/// Thresholds for telling a person. Hours of lessons at the present rate.
struct SpoolThresholds {
  double warn_h = 10;                 ///< less than this in the quota or on the disk: a warning
  double urgent_h = 1;                ///< … the instructor is told as well
  double usual_bytes_per_sample = 8;  ///< what a lesson takes at most
  std::uint64_t enough_samples =
      600'000;  ///< unsent ones from which the spool's own bytes a sample are taken
};

enum class SpoolLevel : std::uint8_t {
  kGood,    ///< nothing to say
  kUnsent,  ///< something waits for a server; there is room
  kWarn,    ///< the quota or the disk is nearly used up
  kUrgent,  ///< over the quota, or hardly any room left
};

struct SpoolOutlook {
  double bytes_per_h = 0;
  double quota_h = 0;  ///< until what is unsent alone fills the quota; 0: it does
  double disk_h = 0;   ///< until the disk is full
  SpoolLevel level = SpoolLevel::kGood;
  std::string text;  ///< for a person; empty when all is good
};

/// Prediction from the spool's own bytes a sample, at this rate. What is unsent is never deleted, over the
/// quota either: then the text says so.
SpoolOutlook outlookOf(const SpoolUsage& usage, std::uint64_t quota_bytes, double rate_hz,
                       const SpoolThresholds& thresholds = {});

/// "3.1 GiB", "25 MiB", "800 KiB", "17 bytes".
std::string sizeText(std::uint64_t bytes);
/// "40 minutes", "12 hours", "60 days", "years".
std::string durationText(double hours);

/// Looks after the spool's room while a lesson runs: removes what the server has, and warns in time.
/// Thread: one, the program's main thread.
class SpoolGuard {
 public:
  using Report = std::function<void(const std::string&)>;
  /// `spool` must outlive it.
  SpoolGuard(Spool& spool, SpoolKeep keep, double rate_hz, Report report, SpoolThresholds thresholds = {})
      : spool_(spool), keep_(keep), rate_hz_(rate_hz), report_(std::move(report)), thresholds_(thresholds) {}

  /// At the start and the end of a lesson: reports how it stands, unless all is good.
  void report();
  /// To be called often: measures every 10 s, and reports what has become worse since the last report.
  void check();
  /// For the status line; empty unless it is urgent.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }
  [[nodiscard]] const SpoolOutlook& outlook() const { return outlook_; }

 private:
  void measure();

  Spool& spool_;
  SpoolKeep keep_;
  double rate_hz_;
  Report report_;
  SpoolThresholds thresholds_;
  SpoolOutlook outlook_;
  SpoolLevel reported_ = SpoolLevel::kUnsent;  // less is not reported within the lesson
  std::string trouble_;
  std::int64_t next_check_ns_ = 0;
};

}  // namespace needlelab
