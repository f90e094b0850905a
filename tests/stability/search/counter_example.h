/// Counter-examples for the passivity observer: gestures that once failed, as kept in ../regressions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/stability/gestures/passivity_gesture.h"
#include "client/sim/stability/gestures/passivity_observer.h"
#include "common/base/result.h"
#include "common/haptics/axial_model.h"

namespace needlelab::test {

/// A gesture that once failed, and its failure.
struct CounterExample {
  std::string source;  ///< the source of the forces, e.g. "reference engine, TILT_WITHOUT_STATE"
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  std::uint64_t seed = 0;  ///< of the random gesture it was shrunk from
  PassivityFinding finding;
  PassivityGesture gesture;
};

/// One stroke per line; a stroke's fields that equal the previous one's are omitted. Ends with a newline.
std::string counterExampleJson(const CounterExample& example);
/// Errors: kInvalidInput naming `source`, field, value and range.
Result<CounterExample> parseCounterExample(std::string_view json, std::string_view source);
Result<CounterExample> loadCounterExample(const std::filesystem::path& path);

/// The first `most` failing gestures of the search, shrunk. Deterministic. Errors: as searchGestures.
Result<std::vector<CounterExample>> counterExamples(const GestureSearch& search, std::string_view source_name,
                                                    AxialModel model, const ForceSourceFactory& source,
                                                    std::size_t most = 1);

}  // namespace needlelab::test
