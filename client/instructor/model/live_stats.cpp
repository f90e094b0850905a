#include "client/instructor/model/live_stats.h"

#include <algorithm>
#include <cmath>

namespace needlelab {

void LiveStats::add(const pb::LiveFrame& frame, std::size_t samples, std::int64_t received_unix_ns) {
  // a smaller number is a station that started again, not a loss
  if (last_seq_ && frame.frame_seq() > *last_seq_ + 1) dropped_ += frame.frame_seq() - *last_seq_ - 1;
  last_seq_ = frame.frame_seq();
  last_latency_ms_ = 1e-6 * static_cast<double>(received_unix_ns - frame.capture_unix_ns());
  latencies_ms_[frames_ % kKept] = static_cast<float>(last_latency_ms_);
  ++frames_;
  samples_ += samples;
}

double LiveStats::latencyMs(double q) const {
  if (frames_ == 0) return 0;
  const auto kept = static_cast<std::ptrdiff_t>(std::min<std::uint64_t>(frames_, kKept));
  std::vector<float> sorted(latencies_ms_.begin(), latencies_ms_.begin() + kept);
  const auto rank = static_cast<std::size_t>(std::ceil(q * static_cast<double>(sorted.size())));
  const std::size_t index = std::clamp<std::size_t>(rank, 1, sorted.size()) - 1;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(index), sorted.end());
  return static_cast<double>(sorted[index]);
}

}  // namespace needlelab
