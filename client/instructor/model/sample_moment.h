/// A Moment from a sample alone, where the engine cannot step along: what the sample carries, and nothing
/// more.
#pragma once

#include "client/view/model/gesture_replica.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// `loop_rate_hz`: of the ticks' numbers. Entry, trajectory, α and the parts of the force stay unknown.
inline Moment momentOfSample(const GestureSample& sample, double loop_rate_hz) {
  Moment moment;
  copySample(sample, loop_rate_hz, moment);
  moment.depth_m = sample.insertion_m;
  moment.approximate = true;
  return moment;
}

}  // namespace needlelab
