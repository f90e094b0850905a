/// What no model must lose to: curves drawn through the bins themselves. They know nothing of tissue, and are
/// no models of the engine.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "client/sim/curves/curve_fit.h"

namespace needlelab {

enum class Baseline : std::uint8_t {
  kConnectTheDots,  ///< straight lines from bin to bin; the end bins' values beyond them
  kHoldTheLast,     ///< the value of the last bin that is not behind; the first bin's before it
};
inline constexpr std::array<Baseline, 2> kBaselines = {Baseline::kConnectTheDots, Baseline::kHoldTheLast};

/// "CONNECT_THE_DOTS", "HOLD_THE_LAST": their names among models, in tables and JSON.
std::string_view nameOf(Baseline baseline);

/// The baseline's value at a depth or time. `bins` in order, at least one. It uses one number for each bin.
double baselineAt(Baseline baseline, const std::vector<CurveBin>& bins, double at);

/// The means of `bins` over equal stretches, at most `most` of them: a baseline of so many numbers. Stretches
/// without bins give none. `most` at least 1; bins in order; their `rows` are not kept.
std::vector<CurveBin> thinned(const std::vector<CurveBin>& bins, std::size_t most);

}  // namespace needlelab
