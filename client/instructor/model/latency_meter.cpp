#include "client/instructor/model/latency_meter.h"

#include <algorithm>
#include <cmath>

namespace needlelab {

void LatencyMeter::fed(std::int64_t capture_unix_ns) {
  // a station without a clock says 0; nobody presents: bounded
  if (capture_unix_ns > 0 && waiting_.size() < 4096) waiting_.push_back(capture_unix_ns);
}

void LatencyMeter::presented(std::int64_t now_unix_ns) {
  for (const std::int64_t capture : waiting_) {
    last_ms_ = 1e-6 * static_cast<double>(now_unix_ns - capture);
    if (shown_ms_.size() < kKept)
      shown_ms_.push_back(static_cast<float>(last_ms_));
    else
      shown_ms_[shown_ % kKept] = static_cast<float>(last_ms_);
    ++shown_;
  }
  waiting_.clear();
}

void LatencyMeter::clear() {
  waiting_.clear();
  shown_ms_.clear();
  shown_ = 0;
  last_ms_ = 0;
}

double LatencyMeter::quantile_ms(double q) const {
  if (shown_ms_.empty()) return 0;
  std::vector<float> sorted(shown_ms_);
  const auto rank =
      static_cast<std::size_t>(std::ceil(std::clamp(q, 0.0, 1.0) * static_cast<double>(sorted.size())));
  const std::size_t index = std::clamp<std::size_t>(rank, 1, sorted.size()) - 1;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(index), sorted.end());
  return static_cast<double>(sorted[index]);
}

}  // namespace needlelab
