/// What each minute was like, from the recording and from what the viewer saw.
#pragma once

#include <filesystem>
#include <vector>

#include "tests/soak/soak_run.h"

namespace needlelab::test {

/// NaN where nothing was seen.
struct SoakMinute {
  double end_s = 0;
  std::uint64_t samples = 0;
  std::uint64_t missed_ticks = 0;  ///< gaps between the ticks of the recording
  double tick_p99_us = 0;          ///< device, engine and gate of a tick, from the recording
  double wakeup_p99_us = 0;        ///< of the haptic loop, since the session began
  double request_p99_ms = 0;       ///< the server's answers
  double live_p99_ms = 0;          ///< from capture to the viewer
};
using SoakMinutes = std::vector<SoakMinute>;

/// Reads the station's spool and the viewer's lines in `options.out`. Errors: kCorrupt, kNotFound.
Result<SoakMinutes> minutesOf(const SoakData& data, const SoakOptions& options);

/// The least of `values` that at least the share q of them does not exceed; NaN when there is none.
double quantile(std::vector<double> values, double q);

}  // namespace needlelab::test
