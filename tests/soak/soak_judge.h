/// Judges whether memory is flat and nothing was lost, with the confidence that the samples allow.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tests/soak/soak_run.h"

namespace needlelab::test {

/// A straight line through the medians of `blocks` equal stretches of time: neighbouring samples are
/// correlated, such medians are nearly independent, and a single spike does not move them.
struct Slope {
  double per_min = 0;
  double half_width_per_min = 0;  ///< of the 95 % interval, by Student's t
  std::size_t blocks = 0;         ///< with samples; fewer than 4: no slope
};
Slope slopeOf(std::span<const double> time_s, std::span<const double> value, std::size_t blocks = 12);

struct SoakLimits {
  double rss_KiB_per_min = 16;          ///< of each process, after the warm-up
  std::uint64_t database_handles = 40;  ///< two for each connection: a writer, 8 idle readers, some borrowed
};

enum class Verdict : std::uint8_t { kGood, kBad };

struct Finding {
  std::string what;
  std::string value;
  std::string limit;  ///< empty: reported, not judged
  Verdict verdict = Verdict::kGood;
};

/// Growth of some memory by its samples at these times, none of them before the warm-up's end. The nightly
/// form judges it: good when the whole interval of the slope is below the limit. The short form only reports
/// it.
Finding flatMemory(const std::string& what, std::span<const double> time_s, std::span<const double> KiB,
                   SoakForm form, const SoakLimits& limits = {});

/// In table order.
std::vector<Finding> judge(const SoakData& data, const SoakOptions& options, const SoakMinutes& minutes,
                           const SoakLimits& limits = {});
/// The worst of them.
Verdict verdictOf(const std::vector<Finding>& findings);
const char* verdictText(Verdict verdict);

// A soak run as files: samples.csv, minutes.csv, table.txt.

/// For a person; the last line is the form and its verdict.
std::string tableText(const std::vector<Finding>& findings, SoakForm form);

/// Into `options.out`. Errors: kFailed.
Status writeReport(const SoakData& data, const SoakOptions& options, const SoakMinutes& minutes,
                   const std::vector<Finding>& findings);

}  // namespace needlelab::test
