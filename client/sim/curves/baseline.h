/// Baselines that every model must beat: curves drawn through the bins themselves. They know nothing of
/// tissue and are not engine models.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "client/sim/curves/curve_fit.h"

namespace needlelab {

enum class Baseline : std::uint8_t {
  kConnectTheDots,  ///< straight lines from bin to bin; constant beyond the end bins
  kHoldTheLast,     ///< the value of the last bin at or before; before the first bin, its value
};
inline constexpr std::array<Baseline, 2> kBaselines = {Baseline::kConnectTheDots, Baseline::kHoldTheLast};

/// "CONNECT_THE_DOTS", "HOLD_THE_LAST": names among the models, in tables and JSON.
std::string_view nameOf(Baseline baseline);

/// The baseline's value at a depth or time. `bins`: ordered, at least one. It uses one number per bin.
double baselineAt(Baseline baseline, const std::vector<CurveBin>& bins, double at);

/// Means of `bins` over at most `most` equal intervals: a baseline with that many numbers. Empty intervals
/// are skipped. `most` is at least 1; bins are ordered; their `rows` are dropped.
std::vector<CurveBin> rebinned(const std::vector<CurveBin>& bins, std::size_t most);

}  // namespace needlelab
