/// What suggests that samples are only a part of a gesture. Pure.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "common/gesture/sample.h"

namespace needlelab {

/// Holes of more than kLongestBridge_s, more than half of the ticks left out, an end in tissue, as many rows
/// as a spreadsheet keeps: sentences for people. Empty: nothing. `rate_hz`: the loop's, above 0.
std::vector<std::string> partOfGesture(std::span<const GestureSample> samples, double rate_hz);

}  // namespace needlelab
