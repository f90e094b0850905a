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
  double rss_KiB_per_min = 16;  ///< of each process, after the warm-up
};

enum class Verdict : std::uint8_t {
  kGood,
  kOpen,  ///< the run was too short to tell
  kBad,
};

struct Finding {
  std::string what;
  std::string value;
  std::string limit;  ///< empty: reported, not judged
  Verdict verdict = Verdict::kGood;
};

/// Memory of a process by its samples at these times, none of them before the warm-up's end. In a `brief` run
/// growth is never bad: an allocator that takes one more block looks the same.
Finding flatMemory(const std::string& process, std::span<const double> time_s,
                   std::span<const double> rss_KiB, bool brief, const SoakLimits& limits = {});

/// In table order. A slope is good when its whole interval is below the limit, bad when all of it is above.
std::vector<Finding> judge(const SoakData& data, const SoakOptions& options, const SoakMinutes& minutes,
                           const SoakLimits& limits = {});
/// The worst of them.
Verdict verdictOf(const std::vector<Finding>& findings);
const char* verdictText(Verdict verdict);
/// Ends the title of a picture; `good` is what to say of a good run.
std::string findingOf(Verdict verdict, std::string_view good);

// A soak run as files: samples.csv, minutes.csv, table.txt, soak.png.

/// For a person; the last line is the verdict.
std::string tableText(const std::vector<Finding>& findings);

/// Into `options.out`. The picture only where gnuplot is. Errors: kFailed.
Status writeReport(const SoakData& data, const SoakOptions& options, const SoakMinutes& minutes,
                   const std::vector<Finding>& findings);

}  // namespace needlelab::test
