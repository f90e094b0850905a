/// The table of all measures of a score. `GET /measures`, the README of this folder, checks of requirements,
/// and comparisons read it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

/// The end of a measure that a teacher would call better, other things being equal.
enum class Better : std::uint8_t { kLess, kMore, kNeither };

/// "less", "more" or "neither".
std::string_view betterName(Better better);

/// The difference below which two values of a measure are the same to a person or to the device: the greater
/// of `absolute` (in the measure's unit) and `share` of the value. Both 0: every difference counts (yes or
/// no).
struct LeastDifference {
  double absolute = 0;
  double share = 0;
};

/// One measure. Texts live as long as the program.
struct MeasureKind {
  std::string_view name;   ///< as in the rows of a score; K stands for a layer's number, from 1
  std::string_view unit;   ///< "m", "s", "N", "m/s", "m^2", "J", "rad", or "" for counts and shares
  std::string_view words;  ///< the name for people
  Better better = Better::kNeither;
  LeastDifference least_difference;
  std::string_view definition;  ///< one or two sentences; the full definition is beside the code
  bool needs_plan = false;      ///< only of exercises with a plan
};

/// All measures in the order of a score's rows; a measure per layer has one row with a K.
std::span<const MeasureKind> measureKinds();
/// Returns the kind of a row's name, e.g. of "peak_force_layer_3_n"; null if the name is unknown.
const MeasureKind* measureKind(std::string_view name);
/// Returns the better direction for a row of this name; `kNeither` for unknown names.
Better betterOf(std::string_view name);
/// Returns the least difference from `value` that counts, in the measure's unit; 0 for unknown names.
double leastDifference(std::string_view name, double value);

/// Returns the words for a row: "Peak force in dura" with the profile's `layerNames`, without them with the
/// layer's number, "Peak force in layer 3"; the name itself if it is unknown.
std::string measureWords(std::string_view name, std::span<const std::string> layer_names = {});

/// Formats a value for people: "3.2 N", "12.4 mm", "0.35 m", "8.1 cm²", "7.5°".
std::string valueText(double value, const std::string& unit);
/// The main measures of a score, shown in lists of sessions if the score has them: elapsed time, peak force,
/// depth, distance from the target, distance from the needle's own line, hazards touched.
std::span<const std::string_view> mainMeasures();

/// The table as JSON: a list of {"measure", "unit", "words", "better", "definition"}.
std::string measureTableJson();
/// The table as Markdown, as in this folder's README.
std::string measureTableMarkdown();

}  // namespace needlelab
