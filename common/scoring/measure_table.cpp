
#include "common/scoring/measure_table.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "common/haptics/limits.h"

namespace needlelab {
namespace {

constexpr Better kLessIsBetter = Better::kLess, kMoreIsBetter = Better::kMore, kNeitherIs = Better::kNeither;

// --- the least differences. The figures of the named sources are from their abstracts (looked up in 2026);
// what has no source is set by hand.

/// Forces: the just-noticeable difference, roughly 7 % from 2.5 to 10 N between the fingers (Pang, Tan and
/// Durlach, "Manual discrimination of force using active finger motion", 1991). 0.06 N, below 0.9 N: set by
/// hand.
constexpr LeastDifference kForceDifference{0.06, 0.07};
/// Lengths, depths and distances: set by hand. Movements of a finger by 6 to 19 mm are told apart by 10 to
/// 18 % (Rinker et al., J. Acoust. Soc. Am. 1998): 1 mm of 6 to 10 mm.
constexpr LeastDifference kLengthDifference{1e-3, 0};
/// Times: set by hand. About two simple reactions of 0.22 s (Laming 1968), one at the beginning and one at
/// the end; above 5 s, 10 % of the time, less than people tell apart (22 % of 3 s and of 6 s: Wackermann,
/// "Asymmetry of the discrimination function for temporal durations in human subjects", 2006).
constexpr LeastDifference kTimeDifference{0.5, 0.10};
/// Speeds: the speed that `translational_actions` calls rest; above 19 mm/s, 8 %: set by hand after the
/// just-noticeable size of a limb's movement (Jones et al., "Differential thresholds for limb movement
/// measured using adaptive techniques", 1992); no source for its speed.
constexpr LeastDifference kSpeedDifference{1.5e-3, 0.08};
/// Swept area: a needle 20 mm deep that is 1 mm aside (kLengthDifference).
constexpr LeastDifference kAreaDifference{2e-5, 0};
/// Work: the least force over the least length, and the share of a force.
constexpr LeastDifference kWorkDifference{6e-5, 0.07};
/// Counts: rounding to whole numbers, uniform within ±1/2: a standard deviation of 1/√12 (Widrow, Kollár and
/// Liu, "Statistical theory of quantization", 1996).
constexpr LeastDifference kCountDifference{0.2887, 0};
/// Shares of the syringe: the least movement of the plunger that is a stroke (syringe_events.h).
constexpr LeastDifference kStrokeDifference{0.02, 0};
/// Ratios and smoothness: what the rate of the recording changes at most, 2 % (invariance_test.cpp).
constexpr LeastDifference kRatioDifference{0, 0.02};
/// Angles: a needle of 60 mm, the usual one of the samples, with its hub 1 mm aside (kLengthDifference).
constexpr LeastDifference kAngleDifference{0.0167, 0};
/// Yes or no.
constexpr LeastDifference kNoDifference{};

constexpr std::array<MeasureKind, 40> kMeasureKinds = {{
    {"elapsed_s", "s", "Elapsed time", kLessIsBetter, kTimeDifference, "from the first tick to the last"},
    {"path_length_m", "m", "Path of the tip", kLessIsBetter, kLengthDifference,
     "sum of the tip's steps on the smoothed track"},
    {"time_in_tissue_s", "s", "Time in tissue", kLessIsBetter, kTimeDifference,
     "while the engine had the tip in a layer"},
    {"path_in_tissue_m", "m", "Path in tissue", kLessIsBetter, kLengthDifference,
     "the part of the path during that time"},
    {"mean_speed_m_s", "m/s", "Mean speed", kNeitherIs, kSpeedDifference, "path over recorded time"},
    {"peak_speed_m_s", "m/s", "Peak speed", kLessIsBetter, kSpeedDifference,
     "greatest speed on the smoothed track"},
    {"tissue_damage_m2", "m^2", "Tissue swept by the shaft", kLessIsBetter, kAreaDifference,
     "area that the shaft's part in tissue sweeps by moving across itself; straight in and out sweeps none"},
    {"sparc", "", "Smoothness (SPARC)", kMoreIsBetter, kRatioDifference,
     "mean spectral arc length of the speed in each movement of the tip that reaches into tissue, weighted "
     "by "
     "their ways; rests between movements do not count; below 0, nearer to 0 is smoother"},
    {"ldlj", "", "Smoothness (LDLJ)", kMoreIsBetter, kRatioDifference,
     "log dimensionless jerk of the speed from first entry to last exit, rests included; nearer to 0 is "
     "smoother"},
    {"translational_actions", "", "Movements of the tip", kLessIsBetter, kCountDifference,
     "stretches of 2 mm or more that begin above 3 mm/s and end when the tip stays below 1.5 mm/s for 0.1 s; "
     "speeds over 0.1 s, so that tremor is none"},
    {"rotational_actions", "", "Turns of the needle", kLessIsBetter, kCountDifference,
     "stretches of 0.05 rad or more that begin above 0.1 rad/s and end when the axis stays below 0.05 rad/s "
     "for 0.1 s; rolling about the axis is none"},
    {"clamping_work_j", "J", "Work against clamping", kLessIsBetter, kWorkDifference,
     "done in tissue by moving the tip across the needle's axis against the force on the hand; what the "
     "tissue gives back is not taken off"},
    {"greatest_depth_m", "m", "Greatest depth", kNeitherIs, kLengthDifference,
     "of the tip under the surface, along its normal"},
    {"greatest_insertion_m", "m", "Greatest insertion", kNeitherIs, kLengthDifference,
     "length of needle in tissue"},
    {"peak_force_n", "N", "Peak force", kLessIsBetter, kForceDifference,
     "greatest force on the hand, of all ticks"},
    {"mean_force_in_tissue_n", "N", "Mean force in tissue", kLessIsBetter, kForceDifference,
     "over the time in tissue"},
    {"peak_force_layer_K_n", "N", "Peak force in layer K", kLessIsBetter, kForceDifference,
     "while the tip was in layer K (1 is the skin's); 0 where it never was; not in the "
     "first 10 ms behind a boundary between layers"},
    {"mean_force_layer_K_n", "N", "Mean force in layer K", kLessIsBetter, kForceDifference,
     "over the same time; no row where the tip never was"},
    {"largest_lateral_error_m", "m", "Largest distance from the needle's own line", kLessIsBetter,
     kLengthDifference, "of the tip from the trajectory that its own entry began, not from a plan"},
    {"entries", "", "Entries", kLessIsBetter, kCountDifference, "times that the tip went in"},
    {"withdrawals", "", "Withdrawals", kLessIsBetter, kCountDifference,
     "times that it was drawn back; a stop on the way does not begin another"},
    {"trajectory_changes", "", "Changes of trajectory", kLessIsBetter, kCountDifference,
     "runs of turns in tissue, pauses up to 0.2 s included"},
    {"path_inefficiency", "", "Way over its own straight way", kLessIsBetter, kRatioDifference,
     "way in tissue up to 0.25 mm before the furthest point over the straight line from its entry; 1 is "
     "straight"},
    {"hazards_touched", "", "Hazards touched", kLessIsBetter, kCountDifference,
     "how many the tip or the shaft in tissue came to"},
    {"bone_contacts", "", "Bone contacts", kLessIsBetter, kCountDifference,
     "times that the tip came into a layer or a hazard of bone; less than 0.2 s out of bone does not begin "
     "another"},
    {"hub_contacts", "", "Contacts of the hub with the skin", kLessIsBetter, kCountDifference,
     "times that the needle came in to its hub; less than 0.2 s off the skin does not begin another"},
    {"target_reached", "", "Target reached", kMoreIsBetter, kNoDifference,
     "1: the tip was in a target, else 0"},
    {"time_at_target_s", "s", "Time at the target", kNeitherIs, kTimeDifference,
     "time of the tip within a target's radius"},
    {"target_distance_m", "m", "Final distance from the target's centre", kLessIsBetter, kLengthDifference,
     "at the furthest point of the last insertion"},
    {"target_nearest_m", "m", "Least distance from the target's centre", kLessIsBetter, kLengthDifference,
     "at any time in tissue"},
    {"planned_entry_error_m", "m", "Entry-site error", kLessIsBetter, kLengthDifference,
     "of the first entry through the skin from the planned one; where the exercise has a plan", true},
    {"planned_angle_error_rad", "rad", "Angle to the planned line", kLessIsBetter, kAngleDifference,
     "of the needle's axis at the furthest point of the last insertion; where the exercise has a plan", true},
    {"mean_planned_line_error_m", "m", "Mean distance from the planned line", kLessIsBetter,
     kLengthDifference, "of the tip, over the time in tissue; where the exercise has a plan", true},
    {"largest_planned_line_error_m", "m", "Largest distance from the planned line", kLessIsBetter,
     kLengthDifference, "of the tip in tissue; where the exercise has a plan", true},
    {"aspirations", "", "Aspirations", kNeitherIs, kCountDifference, "strokes of the plunger outwards"},
    {"injections", "", "Injections", kNeitherIs, kCountDifference, "strokes of the plunger inwards"},
    {"injected_share", "", "Share of the syringe injected", kNeitherIs, kStrokeDifference,
     "of the syringe, all injections together"},
    {"injected_in_target_share", "", "Share of the injection in the target", kMoreIsBetter, kStrokeDifference,
     "of what was injected; where there is a target and an injection"},
    {"aspirated_before_injection", "", "Aspirated before the injection", kMoreIsBetter, kNoDifference,
     "1: an aspiration that began in tissue came before the first injection in tissue, else 0"},
    {"dtw_distance_m", "m", "Distance from the nearest reference gesture", kLessIsBetter, kLengthDifference,
     "mean distance between the paths of the tips in tissue, time warped (DTW), of the nearest reference; "
     "where references are given"},
}};

/// "0.06 N or 7 %"; empty where every difference counts.
std::string differenceText(const MeasureKind& kind) {
  const LeastDifference& least = kind.least_difference;
  std::string text;
  if (least.absolute > 0)
    text = fmt::format("{:g}{}{}", least.absolute, kind.unit.empty() ? "" : " ", kind.unit);
  if (least.share > 0) text += fmt::format("{}{:g} %", text.empty() ? "" : " or ", 100 * least.share);
  return text;
}

/// Whether `name` is `pattern` with a layer's number in place of the K.
bool isLayered(std::string_view name, std::string_view pattern) {
  const std::size_t at = pattern.find('K');
  if (at == std::string_view::npos) return false;
  const std::string_view before = pattern.substr(0, at), after = pattern.substr(at + 1);
  if (!name.starts_with(before) || !name.ends_with(after) || name.size() <= before.size() + after.size())
    return false;
  const std::string_view number = name.substr(at, name.size() - before.size() - after.size());
  std::size_t layer = 0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), layer);
  return error == std::errc() && end == number.data() + number.size() && number[0] != '0' && layer >= 1 &&
         layer <= kMaxLayers;
}

}  // namespace

std::string_view betterName(Better better) {
  switch (better) {
    case Better::kLess:
      return "less";
    case Better::kMore:
      return "more";
    case Better::kNeither:
      break;
  }
  return "neither";
}

std::span<const MeasureKind> measureKinds() {
  return kMeasureKinds;
}

const MeasureKind* measureKind(std::string_view name) {
  const auto* const found =
      std::find_if(kMeasureKinds.begin(), kMeasureKinds.end(), [&](const MeasureKind& kind) {
        // the pattern itself is not the name of a row
        return kind.name.find('K') == std::string_view::npos ? kind.name == name : isLayered(name, kind.name);
      });
  return found == kMeasureKinds.end() ? nullptr : found;
}

Better betterOf(std::string_view name) {
  const MeasureKind* const kind = measureKind(name);
  return kind == nullptr ? Better::kNeither : kind->better;
}

double leastDifference(std::string_view name, double value) {
  const MeasureKind* const kind = measureKind(name);
  if (kind == nullptr) return 0;
  return std::max(kind->least_difference.absolute, kind->least_difference.share * std::abs(value));
}

std::span<const std::string_view> mainMeasures() {
  static constexpr std::array<std::string_view, 6> kMain = {
      "elapsed_s",         "peak_force_n",    "greatest_depth_m", "largest_lateral_error_m",
      "target_distance_m", "hazards_touched",
  };
  return kMain;
}

std::string measureTableJson() {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const MeasureKind& kind : kMeasureKinds) {
    rows.push_back({{"measure", kind.name},
                    {"unit", kind.unit},
                    {"words", kind.words},
                    {"better", betterName(kind.better)},
                    {"definition", kind.definition}});
  }
  return rows.dump();
}

std::string measureTableMarkdown() {
  std::string text =
      "| measure | unit | better | least difference | words | definition |\n|---|---|---|---|---|---|\n";
  for (const MeasureKind& kind : kMeasureKinds) {
    text += "| `" + std::string(kind.name) + "` | " + std::string(kind.unit) + " | " +
            std::string(betterName(kind.better)) + " | " + differenceText(kind) + " | " +
            std::string(kind.words) + " | " + std::string(kind.definition) + " |\n";
  }
  return text;
}

std::string measureWords(std::string_view name, std::span<const std::string> layer_names) {
  const MeasureKind* const kind = measureKind(name);
  std::string words(kind == nullptr ? name : kind->words);
  const std::size_t k = kind == nullptr ? std::string::npos : kind->name.find('K');
  if (k == std::string::npos) return words;
  // a layer's row: its name, or its number in place of the K
  const std::string number(name.substr(k, name.size() - (kind->name.size() - 1)));
  constexpr std::string_view kLayer = "layer K";
  if (const std::size_t layer = std::stoul(number); layer <= layer_names.size())
    words.replace(words.find(kLayer), kLayer.size(), layer_names[layer - 1]);
  else
    words.replace(words.find('K'), 1, number);
  return words;
}

}  // namespace needlelab
