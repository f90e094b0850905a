/// The four recorded hand movements of a real Virtuose as gestures with the engine's forces, for tests and
/// benchmarks.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/gesture/sample.h"

namespace needlelab::test {

/// Folder of the recordings: the variable NEEDLELAB_DATA, otherwise `../shared/data` beside the repository.
/// May not exist.
std::filesystem::path dataFolder();

struct RecordedGesture {
  std::string name;
  std::vector<GestureSample> samples;  ///< 1 kHz; clocks on the tick, without jitter
  double share_in_tissue = 0;
};

/// Returns the available recordings. Interpolates the poses to 1 kHz by the recorded time, then runs the
/// engine with all six effects on a sphere around the far end of the path (its radius is 0.6 of the distance
/// to it), then the gate.
std::vector<RecordedGesture> recordedGestures();

}  // namespace needlelab::test
