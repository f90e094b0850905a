/// Looks for a random gesture whose forces give energy to the hand or step without a cause, and makes what it
/// finds small.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/sim/stability/passivity_check.h"
#include "client/sim/stability/passivity_file.h"
#include "client/sim/stability/passivity_generator.h"

namespace needlelab {

struct PassivitySearch {
  std::uint64_t gestures = 400, first_seed = 1;  ///< seeds in a row; the limbs take turns
  double rate_hz = 1000;
  GestureRange range;
  PassivityLimits limits;
  std::string source_name = "engine";     ///< said in what is found
  std::size_t most_counter_examples = 3;  ///< shrunk; the others are counted only
};

/// The worst of all gestures.
struct PassivityFindings {
  PassivityRecord worst;  ///< of each number; ticks and insertions are sums
  std::uint64_t gestures = 0, failed = 0;
  std::uint64_t energy_seed = 0, step_seed = 0;  ///< of the gesture with the greatest of each
  std::vector<CounterExample> counter_examples;
};

/// Limb of the gesture with this seed.
LimbShape shapeOf(std::uint64_t seed);

/// Deterministic. Errors: those of a source, e.g. a model that is not built.
Result<PassivityFindings> searchGestures(const PassivitySearch& search, AxialModel model,
                                         const ForceSourceFactory& source);

/// Shrinks a gesture that fails `finding.check`.
CounterExample smallestOf(const PassivityGesture& gesture, const PassivityFinding& finding,
                          const PassivityLimits& limits, AxialModel model, const ForceSourceFactory& source);

}  // namespace needlelab
