/// Every measure that a score can have, in one table: what `GET /measures`, the README of this folder, checks
/// of requirements, and comparisons read.
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

/// One measure. Texts live as long as the program.
struct MeasureKind {
  std::string_view name;   ///< as in rows of a score; a K stands for a layer's number, from 1
  std::string_view unit;   ///< "m", "s", "N", "m/s", "m^2", "J", or "" for counts and shares
  std::string_view words;  ///< what a person calls it
  Better better = Better::kNeither;
  std::string_view definition;  ///< in a sentence or two; the whole of it stands beside the code
};

/// In the order of a score's rows; layers as one row each with a K.
std::span<const MeasureKind> measureKinds();
/// The kind that a row's name belongs to, e.g. of "peak_force_layer_3_n"; null where there is none.
const MeasureKind* measureKind(std::string_view name);
/// Which way is better for a row of this name; `kNeither` for unknown ones.
Better betterOf(std::string_view name);

/// What a person calls a row, with its layer's number: "Peak force in layer 3"; the name itself for unknown
/// ones.
std::string measureWords(std::string_view name);

/// A value as a person reads it: "3.2 N", "12.4 mm", "0.35 m", "8.1 cm²".
std::string valueText(double value, const std::string& unit);
/// The few that a list of sessions shows of a score, where it has them: elapsed time, peak force, depth,
/// distance from the target, lateral error, hazards touched.
std::span<const std::string_view> mainMeasures();

/// The table as JSON: a list of {"measure", "unit", "words", "better", "definition"}.
std::string measureTableJson();
/// The table as Markdown, as it stands in this folder's README.
std::string measureTableMarkdown();

}  // namespace needlelab
