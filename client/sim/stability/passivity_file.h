/// Gestures as JSON: the counter-examples of the passivity observer, kept in tests/stability/regressions, and
/// the paths of the prescribed cases in cases.json.
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "client/sim/stability/passivity_check.h"
#include "client/sim/stability/passivity_gesture.h"
#include "common/base/result.h"
#include "common/haptics/axial_model.h"

namespace needlelab {

/// A gesture that once failed, and how.
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

}  // namespace needlelab
