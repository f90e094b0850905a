/// The table of all measures of a score, and a row of a score. `GET /measures`, the README of common/scoring,
/// checks of requirements, and comparisons read the table.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace needlelab {

/// The direction that a teacher would call better, other things being equal.
enum class Better : std::uint8_t { kLess, kMore, kNeither };

/// "less", "more" or "neither".
std::string_view betterName(Better better);

/// How people read a value.
enum class MeasureForm : std::uint8_t {
  kQuantity,  ///< with its unit; counts and ratios have none
  kShare,     ///< 1 is the whole: in percent
  kYesNo,     ///< 1: yes
};

/// What a gesture or an exercise must have for a measure.
enum class MeasureNeed : std::uint8_t {
  kRecording,          ///< a few seconds of recording
  kMovement,           ///< a movement of the tip
  kTissue,             ///< the needle in tissue
  kLayer,              ///< the tip in that layer
  kTarget,             ///< a patient with a target
  kTargetAndTissue,    ///< both
  kPlan,               ///< an exercise with a plan, and the needle in tissue
  kInjectionAtTarget,  ///< an injection, and a target
  kInjectionInTissue,
  kReference,  ///< reference gestures
};

/// One measure. Texts live as long as the program.
struct MeasureKind {
  std::string_view name;   ///< as in the rows of a score; K stands for a layer's number, from 1
  std::string_view unit;   ///< "m", "s", "N", "m/s", "m^2", "J", "rad", or "" for counts and shares
  std::string_view words;  ///< the display name
  Better better = Better::kNeither;
  std::string_view definition;  ///< one or two sentences; the full definition is beside the code
  MeasureNeed need = MeasureNeed::kRecording;  ///< without it there is no row
  MeasureForm form = MeasureForm::kQuantity;
};

/// One row of a score.
struct Measure {
  std::string name;           ///< e.g. "peak_force_n"
  double value = 0;           ///< always finite
  std::string unit;           ///< "m", "s", "N", "m/s", "m^2", "J", "rad", or "" for counts and shares
  std::optional<double> min;  ///< the exercise's requirement, if any
  std::optional<double> max;
  std::optional<bool> passed;  ///< whether the requirement is met; empty without a requirement
  std::string words;           ///< the measure and its requirement as a sentence for a person
  bool measured =
      true;  ///< false: required by the exercise, but this gesture has no such measure; `value` is 0
};

/// All measures in the order of a score's rows; a measure per layer has one row with a K.
std::span<const MeasureKind> measureKinds();
/// Returns the kind of a row's name, e.g. of "peak_force_layer_3_n"; null if the name is unknown.
const MeasureKind* measureKind(std::string_view name);
/// Returns the better direction for a row of this name; `kNeither` for unknown names.
Better betterOf(std::string_view name);
/// Returns the form of a row of this name; `kQuantity` for unknown names.
MeasureForm formOf(std::string_view name);

/// Returns the words for a row: "Peak force in dura" with the profile's `layerNames`, "Peak force in layer 3"
/// without them; the name itself if it is unknown.
std::string measureWords(std::string_view name, std::span<const std::string> layer_names = {});
/// Replaces "layer K" in `text` by the layer's name or number, for a row of this name.
std::string withLayer(std::string text, std::string_view name, std::span<const std::string> layer_names);

/// Formats a value for people: "3.2 N", "12.4 mm", "0.35 m", "8.1 cm²", "7.5°".
std::string valueText(double value, const std::string& unit);
/// "8 %" of a share 0.08: whole percents, because the plunger's resolution is coarser (syringe_events.h).
std::string percentText(double share);
/// Formats a measure's value or limit for people, in its form: "3.2 N", "8 %", "yes". `unit`: the row's.
/// tests/data/scoring/measure_texts.json has examples that also bind the console.
std::string measureText(std::string_view measure, double value, const std::string& unit);
/// As measureText, for a mean or a slope: yes-or-no measures are in percent, because half a yes has no
/// meaning.
std::string meanText(std::string_view measure, double value, const std::string& unit);
/// The requirement on a measure for people: "at most 5 N", "20 mm to 30 mm", "yes"; empty without one.
std::string requirementText(std::string_view measure, const std::string& unit, std::optional<double> min,
                            std::optional<double> max);
/// The main measures of a score, shown in lists of sessions if the score has them: elapsed time, peak force,
/// depth, distance from the target, distance from the needle's own line, hazards touched.
std::span<const std::string_view> mainMeasures();

/// The table as JSON: a list of {"measure", "unit", "words", "better", "definition"}.
std::string measureTableJson();
/// The table as Markdown, as in the README of common/scoring.
std::string measureTableMarkdown();

}  // namespace needlelab
