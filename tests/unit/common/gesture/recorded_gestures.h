/// Recorded hand movements as gestures with the engine's forces, for tests and benchmarks.
#pragma once

#include <string>
#include <vector>

#include "common/gesture/sample.h"
#include "tests/support/recordings/recordings.h"

namespace needlelab::test {

struct RecordedGesture {
  std::string name;
  std::vector<GestureSample> samples;  ///< 1 kHz; the clocks are exactly on the tick
  double share_in_tissue = 0;
};

/// Returns the recordings that can be read: all four or none. Interpolates the poses to 1 kHz by the recorded
/// time, then runs the engine with all six effects on a sphere around the far end of the path (radius 0.6 of
/// the distance to it), then the gate.
std::vector<RecordedGesture> recordedGestures(const Recordings& recordings);

}  // namespace needlelab::test
