/// What an encoder of finite resolution tells of a value.
#pragma once

#include <cmath>

namespace needlelab {

/// `value` rounded to a whole number of steps (half a step goes up); as it is when there is no step. Any
/// unit.
inline double toStep(double value, double step) {
  return step > 0 ? std::floor(value / step + 0.5) * step : value;
}

}  // namespace needlelab
