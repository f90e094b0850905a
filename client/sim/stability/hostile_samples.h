/// Samples of any kind in scenes of any kind: jumps, rests, creeping, grazing, any orientation, now and then
/// no number at all.
#pragma once

#include <cstdint>

#include "client/sim/stability/force_source.h"
#include "common/haptics/axial_model.h"

namespace needlelab {

struct FuzzFindings {
  bool finite = true;
  std::uint64_t ticks = 0, inside = 0;
  double max_force_N = 0;
  double excess_force_N = 0;     ///< of the source, above the scene's greatest force
  double excess_rendered_N = 0;  ///< after the gate, above the device's peak
  double direction_error = 0;    ///< | |u| − 1 |
};

/// Steps new sources of random scenes for `ticks` ticks in all; every sample is given to one source, and to
/// another one behind the gate. Deterministic. Errors: those of the source.
Result<FuzzFindings> fuzzSource(const ForceSourceFactory& source, AxialModel model, std::uint64_t ticks,
                                bool with_gate);

}  // namespace needlelab
