/// Fewer samples for a viewer that asked for a lower rate.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/gesture/sample.h"

namespace needlelab {

/// Keeps the first sample at or behind each point of a time grid of the wanted rate, by the station's own
/// times, so it does not depend on the loop's rate. Thread: one.
class Decimator {
 public:
  /// rate_hz > 0
  explicit Decimator(double rate_hz);

  /// Those of `samples` that the viewer gets; none is a common answer.
  std::vector<GestureSample> keep(std::span<const GestureSample> samples);

 private:
  std::int64_t period_ns_;
  std::int64_t due_ns_ = 0;
  std::int64_t last_ns_ = 0;
  bool started_ = false;
};

}  // namespace needlelab
