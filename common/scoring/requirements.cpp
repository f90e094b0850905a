#include <algorithm>
#include <array>
#include <cstdio>

#include "common/haptics/limits.h"
#include "common/scoring/groups.h"
#include "common/scoring/measure_table.h"

namespace needlelab {
namespace {

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
  if (unit == "J") return size < 1 ? threeDigits(value * 1e3) + " mJ" : threeDigits(value) + " J";
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
  return measureKind(name) != nullptr;
}

Status checkRequirements(const pb::Exercise& exercise) {
  for (int i = 0; i < exercise.requirements_size(); ++i) {
    if (isMeasureName(exercise.requirements(i).measure())) continue;
    std::string known;
    for (const MeasureKind& kind : measureKinds())
      known += (known.empty() ? "" : ", ") + std::string(kind.name);
    return Error{ErrorCode::kInvalidInput, "requirements[" + std::to_string(i) + "].measure: \"" +
                                               exercise.requirements(i).measure() + "\" is none of " + known +
                                               " (K: a layer, 1 to " + std::to_string(kMaxLayers) + ")"};
  }
  return {};
}

}  // namespace needlelab
