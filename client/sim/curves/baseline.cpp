#include "client/sim/curves/baseline.h"

#include <algorithm>
#include <cmath>

namespace needlelab {

std::string_view nameOf(Baseline baseline) {
  return baseline == Baseline::kConnectTheDots ? "CONNECT_THE_DOTS" : "HOLD_THE_LAST";
}

double baselineAt(Baseline baseline, const std::vector<CurveBin>& bins, double at) {
  const auto after = std::upper_bound(bins.begin(), bins.end(), at,
                                      [](double value, const CurveBin& bin) { return value < bin.at; });
  if (after == bins.begin()) return bins.front().value;
  const CurveBin& before = *(after - 1);
  if (after == bins.end() || baseline == Baseline::kHoldTheLast) return before.value;
  return std::lerp(before.value, after->value, (at - before.at) / (after->at - before.at));
}

std::vector<CurveBin> rebinned(const std::vector<CurveBin>& bins, std::size_t most) {
  if (bins.size() <= most) return bins;
  const double from = bins.front().at, width = (bins.back().at - from) / static_cast<double>(most);
  std::vector<CurveBin> means;
  std::vector<std::size_t> counts;
  int last = -1;
  for (const CurveBin& bin : bins) {
    const int part = std::min(static_cast<int>(most) - 1, static_cast<int>((bin.at - from) / width));
    if (part != last) {
      means.emplace_back();
      counts.push_back(0);
      last = part;
    }
    means.back().at += bin.at;
    means.back().value += bin.value;
    ++counts.back();
  }
  for (std::size_t i = 0; i < means.size(); ++i) {
    means[i].at /= static_cast<double>(counts[i]);
    means[i].value /= static_cast<double>(counts[i]);
  }
  return means;
}

}  // namespace needlelab
