/// Strokes of the plunger in a recording: when and how far, not yet where. Private to this folder.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "common/gesture/sample.h"

namespace needlelab {

/// A movement in one direction, from sample `first` to sample `last` (indices).
struct Stroke {
  std::size_t first = 0, last = 0;
  double from = 0, to = 0;  ///< plunger at its ends, averaged over 10 ms
};

/// Whether the plunger of a sample can be used: `cleaned` does not look at it.
inline bool hasPlunger(const GestureSample& sample) {
  return sample.plunger >= -0.01 && sample.plunger <= 1.01;
}

/// The strokes of a cleaned recording, in order (syringe_events.h says what one is).
std::vector<Stroke> strokesOf(std::span<const GestureSample> cleaned_samples, double rate_hz);

}  // namespace needlelab
