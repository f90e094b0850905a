/// Looks after the spool's room while a lesson runs: lets go what the server has, and says in time what is
/// short.
#pragma once

#include <functional>
#include <string>

#include "client/net/spool_outlook.h"

namespace needlelab {

/// Thread: one, the program's main thread.
class SpoolGuard {
 public:
  using Say = std::function<void(const std::string&)>;
  /// `spool` must outlive it.
  SpoolGuard(Spool& spool, SpoolKeep keep, double rate_hz, Say say, SpoolThresholds thresholds = {})
      : spool_(spool), keep_(keep), rate_hz_(rate_hz), say_(std::move(say)), thresholds_(thresholds) {}

  /// At the start and the end of a lesson: says how it stands, when there is something to say.
  void report();
  /// Often: looks every 10 s, and says what has become worse since it was last said.
  void look();
  /// For the status line; empty unless it is urgent.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }
  [[nodiscard]] const SpoolOutlook& outlook() const { return outlook_; }

 private:
  void measure();

  Spool& spool_;
  SpoolKeep keep_;
  double rate_hz_;
  Say say_;
  SpoolThresholds thresholds_;
  SpoolOutlook outlook_;
  SpoolLevel said_ = SpoolLevel::kUnsent;  // less is not said in the lesson
  std::string trouble_;
  std::int64_t next_look_ns_ = 0;
};

}  // namespace needlelab
