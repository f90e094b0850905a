#include "client/net/backoff.h"

#include <algorithm>
#include <cmath>

namespace needlelab {

std::chrono::milliseconds Backoff::next() {
  const double most = static_cast<double>(settings_.most.count());
  const double grown =
      static_cast<double>(settings_.first.count()) * std::pow(settings_.factor, std::min(tries_, 1000u));
  const double wait = std::min(most, grown);
  ++tries_;
  // 53 random bits: a number in [0, 1) by hand, because std's distributions differ between libraries
  const double u = static_cast<double>(random_() >> 11) * 0x1p-53;
  return std::chrono::milliseconds(static_cast<std::int64_t>(wait * (0.5 + 0.5 * u)));
}

}  // namespace needlelab
