#include "common/scoring/motion/part_of_gesture.h"

#include <fmt/core.h>

#include <cstddef>
#include <cstdint>

#include "common/scoring/motion/motion_cost.h"
#include "common/scoring/motion/recorded_samples.h"

namespace needlelab {

std::vector<std::string> partOfGesture(std::span<const GestureSample> samples, double rate_hz) {
  constexpr std::size_t kSpreadsheetRows = (1u << 20) - 1;  // below the heading
  std::vector<std::string> found;
  double missing_s = 0;
  int holes = 0;
  std::uint64_t bridged = 0;  // ticks
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const double gap_s = secondsBetween(samples[i - 1], samples[i], rate_hz);
    if (gap_s <= kLongestBridge_s) {
      bridged += samples[i].tick - samples[i - 1].tick - 1;
      continue;
    }
    missing_s += gap_s;
    ++holes;
  }
  if (holes > 0)
    found.push_back(fmt::format("{:.1f} s of the gesture are missing, in {} {}: the station stood still",
                                missing_s, holes, holes == 1 ? "hole" : "holes"));
  if (bridged > samples.size())
    found.push_back(
        fmt::format("{} of {} ticks are there: measures are near those of all; session export "
                    "--every-tick writes all that a server has",
                    samples.size(), samples.size() + bridged));
  if (samples.size() == kSpreadsheetRows)
    found.push_back("1048575 samples are as many as a spreadsheet keeps: the rest may be missing");
  if (!samples.empty() && isInside(samples.back()))
    found.push_back("the samples end in tissue: the rest of the gesture may be missing");
  return found;
}

}  // namespace needlelab
