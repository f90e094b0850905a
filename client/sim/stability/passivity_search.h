/// Gestures as JSON: the counter-examples of the passivity observer, kept in tests/stability/regressions, and
/// the paths of the prescribed cases in cases.json.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/stability/passivity_gesture.h"
#include "client/sim/stability/passivity_observer.h"
#include "common/base/result.h"
#include "common/haptics/axial_model.h"

namespace needlelab {

/// A gesture that once failed, and its failure.
struct CounterExample {
  std::string source;  ///< what gave the forces, e.g. "reference engine, TILT_WITHOUT_STATE"
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  std::uint64_t seed = 0;  ///< of the random gesture that it was shrunk from
  PassivityFinding finding;
  PassivityGesture gesture;
};

/// One stroke a line; a stroke's fields that are as in the one before are left out. Ends with a newline.
std::string counterExampleJson(const CounterExample& example);
/// Errors: kInvalidInput naming `source`, field, value and range.
Result<CounterExample> parseCounterExample(std::string_view json, std::string_view source);
Result<CounterExample> loadCounterExample(const std::filesystem::path& path);

/// Reads `start`, `strokes` and, where present, `rate_hz`, `tremor_m`, `tremor_seed` and `encoder_step_m`
/// into `gesture`; its profile stays. Unknown fields are refused. Errors as above, fields named from `where`
/// on.
Status readMotion(const nlohmann::json& json, const std::string& where, PassivityGesture& gesture);

struct ShrinkResult {
  PassivityGesture gesture;
  std::size_t tried = 0, taken = 0;  ///< smaller gestures
};

/// `fails` must hold for `gesture`; it is called at most `most_tries` times. Removes strokes, effects,
/// layers, membranes, tremor and encoder, replaces the limb by a plane, shortens, and rounds numbers, over
/// and over until nothing helps. Each step makes `sizeOf` less, so it ends. Deterministic.
ShrinkResult shrunk(const PassivityGesture& gesture,
                    const std::function<bool(const PassivityGesture&)>& fails, std::size_t most_tries = 3000);

struct PassivitySearch {
  std::uint64_t gestures = 400, first_seed = 1;  ///< seeds in a row; the limbs take turns
  std::uint64_t with_stages = 0;  ///< … and so many more, on the seeds that follow, with `range.stages`
  double rate_hz = 1000;
  GestureRange range;
  PassivityLimits limits;
  std::string source_name = "engine";     ///< written into counter-examples
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
