#include "server/live/decimator.h"

#include <algorithm>
#include <cmath>

namespace needlelab {

Decimator::Decimator(double rate_hz)
    : period_ns_(std::max<std::int64_t>(
          1, static_cast<std::int64_t>(std::llround(1e9 / std::max(rate_hz, 1e-3))))) {}

std::vector<GestureSample> Decimator::keep(std::span<const GestureSample> samples) {
  std::vector<GestureSample> kept;
  for (const GestureSample& sample : samples) {
    // a new session, or a station that started again: its clock starts elsewhere
    const bool jumped = started_ && sample.time_ns < last_ns_;
    if (!started_ || jumped) {
      started_ = true;
      due_ns_ = sample.time_ns;
    }
    last_ns_ = sample.time_ns;
    if (sample.time_ns < due_ns_) continue;
    kept.push_back(sample);
    // the next point of the grid that lies ahead
    const auto periods = (static_cast<std::uint64_t>(sample.time_ns) - static_cast<std::uint64_t>(due_ns_)) /
                             static_cast<std::uint64_t>(period_ns_) +
                         1;
    due_ns_ = static_cast<std::int64_t>(static_cast<std::uint64_t>(due_ns_) +
                                        periods * static_cast<std::uint64_t>(period_ns_));
  }
  return kept;
}

}  // namespace needlelab
