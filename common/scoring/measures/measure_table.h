/// The table of all measures of a score (its rows: measure_rows.cpp), and a row of a score. Scores, `GET
/// /measures`, the README of common/scoring, checks of requirements, comparisons, screens and the console
/// read the table; nothing else names a measure.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

struct GestureFacts;

/// The version of all definitions in common/scoring that affect a value; its history is in measure_rows.cpp.
/// Stored scores contain their version.
extern const std::uint32_t kScoreDefinitionVersion;

/// The direction that a teacher would call better, other things being equal. An exercise usually limits
/// `kLess` from above, `kMore` from below, and `kNeither` from both sides.
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
  kLandmark,   ///< a patient with a landmark, found with the cap on
};

/// What other parts of the program look for a measure by. One measure has each role but kNone.
enum class MeasureRole : std::uint8_t {
  kNone,
  kTime,         ///< an exercise's time limit is a requirement on it
  kForce,        ///< greatest force: its limits are drawn in plots and raise alarms
  kSpeed,        ///< greatest speed: its limits are drawn
  kDepth,        ///< greatest depth: its limits are drawn and raise alarms
  kOwnLine,      ///< greatest distance from the needle's own line: its limits are drawn
  kPlannedLine,  ///< greatest distance from the planned line: its limits are drawn
  kTarget,       ///< what a new exercise requires
  kHazard,       ///< contacts, of which a replay shows the moments
  kBone,
  kHub,
  kExpertPath,  ///< distance from references: of those of today, not of those at the time of scoring
};
inline constexpr std::size_t kMeasureRoleCount = 12;

/// Words of a yes-or-no measure besides its own, which are those of a yes.
struct YesNoWords {
  std::string_view no;        ///< "Target not reached"
  std::string_view unwanted;  ///< said of a yes that the exercise forbids: "it had to be avoided"
};

/// Why a gesture with this measure above 0 is no reference.
struct FaultWords {
  std::string_view one;   ///< "touched 1 hazard"
  std::string_view many;  ///< a format: "touched {} hazards"
};

/// One measure: all that the program knows of it. Texts live as long as the program.
struct MeasureKind {
  std::string_view name;       ///< as in the rows of a score; K stands for a layer's number, from 1
  std::string_view unit = {};  ///< "m", "s", "N", "m/s", "m^2", "J", "rad", or "" for counts and shares
  std::string_view words;      ///< the display name
  Better better = Better::kNeither;
  std::string_view definition;  ///< one or two sentences; the full definition is beside the code
  /// Computes the value; nothing, or a value that is not finite: the gesture has no such row. `layer`: from
  /// 0; 0 for a measure that is not one per layer.
  std::optional<double> (*value)(const GestureFacts& facts, std::size_t layer) = nullptr;
  MeasureNeed need = MeasureNeed::kRecording;  ///< without it there is no row
  MeasureForm form = MeasureForm::kQuantity;
  MeasureRole role = MeasureRole::kNone;
  std::uint8_t in_lists = 0;    ///< place among the main measures in lists of sessions, from 1; 0: none
  std::uint8_t in_reports = 0;  ///< place among the plots of progress in a report, from 1; 0: none
  /// For measures without a unit: the largest difference between two rates of the loop that counts as equal
  /// in studies.
  double rate_tolerance = 0;
  bool over_holes = false;  ///< holds although a part of the recording is missing
  YesNoWords yes_no = {};   ///< for MeasureForm::kYesNo
  FaultWords fault = {};    ///< empty: does not spoil a reference
  std::string (*detail)(const GestureFacts& facts) = nullptr;  ///< appended to the words of a score's row
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
  bool incomplete = false;     ///< a hole in the recording may hide a part of it
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
/// Returns the role of a row of this name; `kNone` for unknown names.
MeasureRole roleOf(std::string_view name);
/// Returns the measure with this role, not kNone.
const MeasureKind& measureOf(MeasureRole role);
/// Returns the names of the measures with a place, in its order: `&MeasureKind::in_lists`, `in_reports`.
std::vector<std::string_view> measuresIn(std::uint8_t MeasureKind::*place);

/// Whether the row says 0 N of a tissue that the tip never was in, and nothing is required there: no row of a
/// score (until definition 12 it was one) or a table.
bool isOfTissueNotMet(const Measure& row);

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
/// A row's value for people: "3.2 N", "2.3 s (incomplete)"; its words if nothing was measured.
std::string rowText(const Measure& row);
/// As measureText, for a mean or a slope: yes-or-no measures are in percent, because half a yes has no
/// meaning.
std::string meanText(std::string_view measure, double value, const std::string& unit);
/// The requirement on a measure for people: "at most 5 N", "20 mm to 30 mm", "yes"; empty without one.
std::string requirementText(std::string_view measure, const std::string& unit, std::optional<double> min,
                            std::optional<double> max);
/// The table as Markdown, as in the README of common/scoring.
std::string measureTableMarkdown();

}  // namespace needlelab
