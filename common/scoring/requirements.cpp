#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>

#include "haptics/limits.h"
#include "scoring/groups.h"

namespace needlelab {
namespace {

constexpr std::array<std::string_view, 28> kNames = {"elapsed_s",
                                                     "path_length_m",
                                                     "time_in_tissue_s",
                                                     "path_in_tissue_m",
                                                     "mean_speed_m_s",
                                                     "peak_speed_m_s",
                                                     "tissue_damage_m2",
                                                     "sparc",
                                                     "ldlj",
                                                     "greatest_depth_m",
                                                     "peak_force_n",
                                                     "greatest_insertion_m",
                                                     "entries",
                                                     "mean_force_in_tissue_n",
                                                     "largest_lateral_error_m",
                                                     "withdrawals",
                                                     "trajectory_changes",
                                                     "path_inefficiency",
                                                     "hazards_touched",
                                                     "target_reached",
                                                     "time_at_target_s",
                                                     "target_distance_m",
                                                     "target_nearest_m",
                                                     "aspirations",
                                                     "injections",
                                                     "injected_share",
                                                     "injected_in_target_share",
                                                     "aspirated_before_injection"};

/// "3.2", "0.05", "120": three significant digits, no exponent for the sizes that occur, no zeros at the end.
std::string threeDigits(double value) {
  std::array<char, 64> text{};
  const double size = std::abs(value);
  const int decimals = size >= 100 || size == 0 ? 0 : size >= 10 ? 1 : size >= 1 ? 2 : 3;
  if (size > 1e9) {
    std::snprintf(text.data(), text.size(), "%.3g", value);
    return text.data();
  }
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  std::string digits = text.data();
  if (digits.find('.') == std::string::npos) return digits;
  digits.erase(digits.find_last_not_of('0') + 1);
  if (digits.back() == '.') digits.pop_back();
  return digits == "-0" ? "0" : digits;
}

/// "Peak force 3.2 N", or a plain statement where a number would be odd.
std::string statement(const Measure& row) {
  if (row.name == "target_reached") return row.value > 0 ? "Target reached" : "Target not reached";
  if (row.name == "aspirated_before_injection")
    return row.value > 0 ? "Aspirated before the injection" : "Not aspirated before the injection";
  return row.words + " " + valueText(row.value, row.unit);
}

std::string verdict(const Measure& row) {
  if (row.name == "aspirated_before_injection")
    return *row.passed ? "" : row.value > 0 ? ": it was not to be done" : ": it had to be";
  if (row.name == "target_reached")
    return *row.passed ? "" : row.value > 0 ? ": it was to be left alone" : ": it had to be";
  const auto text = [&](double value) { return valueText(value, row.unit); };
  // where rounding hides the difference, say that there is one
  const auto just = [&](double limit) { return text(limit) == text(row.value) ? "just " : ""; };
  if (row.min && row.value < *row.min) {
    return std::string(": ") + just(*row.min) + "below the " + text(*row.min) + " asked for";
  }
  if (row.max && row.value > *row.max) {
    return std::string(": ") + just(*row.max) + "above the " + text(*row.max) + " allowed";
  }
  if (row.min && row.max) return ": within " + text(*row.min) + " to " + text(*row.max);
  return row.max ? ": within the " + text(*row.max) + " allowed"
                 : ": at least the " + text(*row.min) + " asked for";
}

/// Narrows a row's requirement; several on the same measure all hold.
void require(Measure& row, std::optional<double> min, std::optional<double> max) {
  if (min) row.min = row.min ? std::max(*row.min, *min) : *min;
  if (max) row.max = row.max ? std::min(*row.max, *max) : *max;
}

void require(std::vector<Measure>& measures, const std::string& name, std::optional<double> min,
             std::optional<double> max) {
  auto row = std::find_if(measures.begin(), measures.end(), [&](const Measure& m) { return m.name == name; });
  if (row == measures.end()) {
    Measure missing;
    missing.name = name;
    missing.measured = false;
    row = measures.insert(measures.end(), missing);
  }
  require(*row, min, max);
}

}  // namespace

std::string valueText(double value, const std::string& unit) {
  const double size = std::abs(value);
  if (unit == "m") return size < 1 ? threeDigits(value * 1e3) + " mm" : threeDigits(value) + " m";
  if (unit == "m/s") return size < 1 ? threeDigits(value * 1e3) + " mm/s" : threeDigits(value) + " m/s";
  if (unit == "m^2") return threeDigits(value * 1e4) + " cm²";
  return unit.empty() ? threeDigits(value) : threeDigits(value) + " " + unit;
}

void applyRequirements(const pb::Exercise* exercise, std::vector<Measure>& measures) {
  if (exercise != nullptr) {
    if (exercise->has_time_limit_s()) require(measures, "elapsed_s", {}, exercise->time_limit_s());
    for (const auto& r : exercise->requirements()) {
      require(measures, r.measure(), r.has_min() ? std::optional(r.min()) : std::nullopt,
              r.has_max() ? std::optional(r.max()) : std::nullopt);
    }
  }
  for (Measure& row : measures) {
    const bool is_required = row.min || row.max;
    if (!row.measured) {
      row.passed = false;
      row.words = isMeasureName(row.name) ? row.name + " could not be measured in this gesture"
                                          : row.name + " is no measure that this program knows";
      continue;
    }
    if (is_required) row.passed = (!row.min || row.value >= *row.min) && (!row.max || row.value <= *row.max);
    row.words = statement(row) + (is_required ? verdict(row) : "");
  }
}

bool isMeasureName(std::string_view name) {
  if (std::find(kNames.begin(), kNames.end(), name) != kNames.end()) return true;
  constexpr std::string_view kPrefix = "peak_force_layer_", kSuffix = "_n";
  if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix) || name.size() < kPrefix.size() + kSuffix.size())
    return false;
  const std::string_view number = name.substr(kPrefix.size(), name.size() - kPrefix.size() - kSuffix.size());
  std::size_t layer = 0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), layer);
  return error == std::errc() && end == number.data() + number.size() && number[0] != '0' && layer >= 1 &&
         layer <= kMaxLayers;
}

Status checkRequirements(const pb::Exercise& exercise) {
  for (int i = 0; i < exercise.requirements_size(); ++i) {
    if (isMeasureName(exercise.requirements(i).measure())) continue;
    std::string known;
    for (const std::string_view name : kNames) known += std::string(name) + ", ";
    return Error{ErrorCode::kInvalidInput, "requirements[" + std::to_string(i) + "].measure: \"" +
                                               exercise.requirements(i).measure() + "\" is none of " + known +
                                               "peak_force_layer_1_n to peak_force_layer_" +
                                               std::to_string(kMaxLayers) + "_n"};
  }
  return {};
}

}  // namespace needlelab
