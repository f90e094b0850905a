
#include "common/scoring/measures/measure_table.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "common/base/text/text.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {
namespace {

constexpr Better kLessIsBetter = Better::kLess, kMoreIsBetter = Better::kMore, kNeitherIs = Better::kNeither;

using Need = MeasureNeed;
using Form = MeasureForm;

constexpr std::array<MeasureKind, 40> kMeasureKinds = {{
    {"elapsed_s", "s", "Elapsed time", kLessIsBetter, "from the first tick to the last"},
    {"path_length_m", "m", "Path of the tip", kLessIsBetter, "sum of the tip's steps on the smoothed track"},
    {"time_in_tissue_s", "s", "Time in tissue", kLessIsBetter, "while the engine had the tip in a layer"},
    {"path_in_tissue_m", "m", "Path in tissue", kLessIsBetter, "the part of the path during that time"},
    {"mean_speed_m_s", "m/s", "Mean speed", kNeitherIs, "path over recorded time"},
    {"peak_speed_m_s", "m/s", "Peak speed", kLessIsBetter, "greatest speed on the smoothed track"},
    {"tissue_damage_m2", "m^2", "Tissue swept by the shaft", kLessIsBetter,
     "area that the shaft's part in tissue sweeps by moving across itself; straight in and out sweeps none"},
    {"sparc", "", "Smoothness (SPARC)", kMoreIsBetter,
     "mean spectral arc length of the speed in each movement of the tip that reaches into tissue, weighted "
     "by "
     "their ways; rests between movements do not count; below 0, nearer to 0 is smoother",
     Need::kMovement},
    {"ldlj", "", "Smoothness (LDLJ)", kMoreIsBetter,
     "log dimensionless jerk of the speed from first entry to last exit, rests included; nearer to 0 is "
     "smoother",
     Need::kMovement},
    {"translational_actions", "", "Movements of the tip", kLessIsBetter,
     "stretches of 2 mm or more that begin above 3 mm/s and end when the tip stays below 1.5 mm/s for 0.1 s; "
     "speeds are measured over 0.1 s, so that tremor does not count"},
    {"rotational_actions", "", "Turns of the needle", kLessIsBetter,
     "stretches of 0.05 rad or more that begin above 0.1 rad/s and end when the axis stays below 0.05 rad/s "
     "for 0.1 s; rolling about the axis does not count"},
    {"clamping_work_j", "J", "Work against clamping", kLessIsBetter,
     "done in tissue by moving the tip across the needle's axis against the force on the hand; energy that "
     "the tissue returns is not subtracted"},
    {"greatest_depth_m", "m", "Greatest depth", kNeitherIs, "of the tip under the surface, along its normal"},
    {"greatest_insertion_m", "m", "Greatest insertion", kNeitherIs, "length of needle in tissue"},
    {"peak_force_n", "N", "Peak force", kLessIsBetter, "greatest force on the hand, of all ticks"},
    {"mean_force_in_tissue_n", "N", "Mean force in tissue", kLessIsBetter, "over the time in tissue"},
    {"peak_force_layer_K_n", "N", "Peak force in layer K", kLessIsBetter,
     "while the tip was in layer K (1 is the skin's); 0 where it never was; not in the "
     "first 10 ms behind a boundary between layers",
     Need::kLayer},
    {"mean_force_layer_K_n", "N", "Mean force in layer K", kLessIsBetter,
     "over the same time; no row where the tip never was", Need::kLayer},
    {"largest_lateral_error_m", "m", "Largest distance from the needle's own line", kLessIsBetter,
     "of the tip from the trajectory that its own entry began, not from a plan"},
    {"entries", "", "Entries", kLessIsBetter, "times that the tip went in"},
    {"withdrawals", "", "Withdrawals", kLessIsBetter,
     "times that it was drawn back; a stop on the way does not begin another"},
    {"trajectory_changes", "", "Changes of trajectory", kLessIsBetter,
     "runs of turns in tissue, pauses up to 0.2 s included"},
    {"path_inefficiency", "", "Way over its own straight way", kLessIsBetter,
     "way in tissue up to 0.25 mm before the furthest point over the straight line from its entry; 1 is "
     "straight",
     Need::kTissue},
    {"hazards_touched", "", "Hazards touched", kLessIsBetter,
     "how many hazards the tip or the shaft in tissue touched"},
    {"bone_contacts", "", "Bone contacts", kLessIsBetter,
     "how often the tip touched a bone layer or bone hazard; less than 0.2 s out of bone does not begin "
     "another contact"},
    {"hub_contacts", "", "Contacts of the hub with the skin", kLessIsBetter,
     "how often the needle went in to its hub; less than 0.2 s off the skin does not begin another contact"},
    {"target_reached", "", "Target reached", kMoreIsBetter,
     "1: the tip was in a target, in one of its tissues, else 0", Need::kTarget, Form::kYesNo},
    {"time_at_target_s", "s", "Time at the target", kNeitherIs,
     "time of the tip in a target, in one of its tissues", Need::kTarget},
    {"target_distance_m", "m", "Distance from the target's centre at the deepest point", kLessIsBetter,
     "at the furthest point of the last insertion", Need::kTargetAndTissue},
    {"target_nearest_m", "m", "Least distance from the target's centre", kLessIsBetter,
     "at any time in tissue", Need::kTargetAndTissue},
    {"planned_entry_error_m", "m", "Entry-site error", kLessIsBetter,
     "of the first entry through the skin from the planned one; where the exercise has a plan", Need::kPlan},
    {"planned_angle_error_rad", "rad", "Angle to the planned line", kLessIsBetter,
     "of the needle's axis at the furthest point of the last insertion; where the exercise has a plan",
     Need::kPlan},
    {"mean_planned_line_error_m", "m", "Mean distance from the planned line", kLessIsBetter,
     "of the tip, over the time in tissue; where the exercise has a plan", Need::kPlan},
    {"largest_planned_line_error_m", "m", "Largest distance from the planned line", kLessIsBetter,
     "of the tip in tissue; where the exercise has a plan", Need::kPlan},
    {"aspirations", "", "Aspirations", kNeitherIs, "strokes of the plunger outwards"},
    {"injections", "", "Injections", kNeitherIs, "strokes of the plunger inwards"},
    {"injected_share", "", "Share of the syringe injected", kNeitherIs,
     "of the syringe, all injections together", Need::kRecording, Form::kShare},
    {"injected_in_target_share", "", "Share of the injection in the target", kMoreIsBetter,
     "of what was injected, by where the needle's opening was; where there is a target and an injection",
     Need::kInjectionAtTarget, Form::kShare},
    {"aspirated_before_injection", "", "Aspirated before the injection", kMoreIsBetter,
     "1: an aspiration that began in tissue came before the first injection in tissue, else 0",
     Need::kInjectionInTissue, Form::kYesNo},
    {"dtw_distance_m", "m", "Distance from the nearest reference gesture", kLessIsBetter,
     "mean distance between the paths of the tips in tissue, time warped (DTW), of the nearest reference; "
     "where references are given",
     Need::kReference},
}};

/// "3.2", "0.05", "120": three significant digits, no exponent at the magnitudes that occur, no trailing
/// zeros.
std::string threeDigits(double value) {
  const double size = std::abs(value);
  const int decimals = size >= 100 || size == 0 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3;
  if (size > 1e9) return fmt::format("{:.3g}", value);
  std::string digits = fixedText(value, decimals);
  if (digits.find('.') == std::string::npos) return digits;
  digits.erase(digits.find_last_not_of('0') + 1);
  if (digits.back() == '.') digits.pop_back();
  return digits;
}

/// Whether `name` is `pattern` with a layer's number instead of the K.
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

MeasureForm formOf(std::string_view name) {
  const MeasureKind* const kind = measureKind(name);
  return kind == nullptr ? MeasureForm::kQuantity : kind->form;
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
  std::string text = "| measure | unit | better | words | definition |\n|---|---|---|---|---|\n";
  for (const MeasureKind& kind : kMeasureKinds) {
    text += "| `" + std::string(kind.name) + "` | " + std::string(kind.unit) + " | " +
            std::string(betterName(kind.better)) + " | " + std::string(kind.words) + " | " +
            std::string(kind.definition) + " |\n";
  }
  return text;
}

std::string withLayer(std::string text, std::string_view name, std::span<const std::string> layer_names) {
  const MeasureKind* const kind = measureKind(name);
  const std::size_t k = kind == nullptr ? std::string::npos : kind->name.find('K');
  constexpr std::string_view kLayer = "layer K";
  const std::size_t at = text.find(kLayer);
  if (k == std::string::npos || at == std::string::npos) return text;
  const std::string number(name.substr(k, name.size() - (kind->name.size() - 1)));
  const std::size_t layer = std::stoul(number);
  text.replace(at, kLayer.size(), layer <= layer_names.size() ? layer_names[layer - 1] : "layer " + number);
  return text;
}

std::string measureWords(std::string_view name, std::span<const std::string> layer_names) {
  const MeasureKind* const kind = measureKind(name);
  return kind == nullptr ? std::string(name) : withLayer(std::string(kind->words), name, layer_names);
}

std::string valueText(double value, const std::string& unit) {
  const double size = std::abs(value);
  if (unit == "m") return size < 1 ? threeDigits(value * 1e3) + " mm" : threeDigits(value) + " m";
  if (unit == "m/s") return size < 1 ? threeDigits(value * 1e3) + " mm/s" : threeDigits(value) + " m/s";
  if (unit == "J") return size < 1 ? threeDigits(value * 1e3) + " mJ" : threeDigits(value) + " J";
  if (unit == "m^2") return threeDigits(value * 1e4) + " cm²";
  if (unit == "rad") return threeDigits(value * 180 / std::numbers::pi) + "°";
  return unit.empty() ? threeDigits(value) : threeDigits(value) + " " + unit;
}

std::string percentText(double share) {
  return fixedText(100 * share, 0) + " %";
}

std::string measureText(std::string_view measure, double value, const std::string& unit) {
  switch (formOf(measure)) {
    case MeasureForm::kShare:
      return percentText(value);
    case MeasureForm::kYesNo:
      return value > 0 ? "yes" : "no";
    case MeasureForm::kQuantity:
      break;
  }
  return valueText(value, unit);
}

std::string meanText(std::string_view measure, double value, const std::string& unit) {
  return formOf(measure) == MeasureForm::kYesNo ? percentText(value) : measureText(measure, value, unit);
}

std::string requirementText(std::string_view measure, const std::string& unit, std::optional<double> min,
                            std::optional<double> max) {
  const auto text = [&](double value) { return measureText(measure, value, unit); };
  if (!min && !max) return {};
  if (formOf(measure) == MeasureForm::kYesNo) return min.value_or(0) > 0 ? "yes" : "no";
  if (min && max) return text(*min) + " to " + text(*max);
  return min ? "at least " + text(*min) : "at most " + text(*max);
}

}  // namespace needlelab
