#include "common/scoring/measures/measure_table.h"

#include <fmt/core.h>

#include <algorithm>
#include <cassert>
#include <charconv>
#include <cmath>

#include "common/base/text/text.h"
#include "common/base/units.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {
namespace {

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

const MeasureKind* measureKind(std::string_view name) {
  const auto kinds = measureKinds();
  const auto found = std::find_if(kinds.begin(), kinds.end(), [&](const MeasureKind& kind) {
    // the pattern itself is not the name of a row
    return kind.name.find('K') == std::string_view::npos ? kind.name == name : isLayered(name, kind.name);
  });
  return found == kinds.end() ? nullptr : &*found;
}

Better betterOf(std::string_view name) {
  const MeasureKind* const kind = measureKind(name);
  return kind == nullptr ? Better::kNeither : kind->better;
}

MeasureForm formOf(std::string_view name) {
  const MeasureKind* const kind = measureKind(name);
  return kind == nullptr ? MeasureForm::kQuantity : kind->form;
}

bool isOfTissueNotMet(const Measure& row) {
  const MeasureKind* const kind = measureKind(row.name);
  return kind != nullptr && kind->need == MeasureNeed::kLayer && row.value == 0 && !row.passed;
}

MeasureRole roleOf(std::string_view name) {
  const MeasureKind* const kind = measureKind(name);
  return kind == nullptr ? MeasureRole::kNone : kind->role;
}

const MeasureKind& measureOf(MeasureRole role) {
  const auto kinds = measureKinds();
  const auto found =
      std::find_if(kinds.begin(), kinds.end(), [&](const MeasureKind& kind) { return kind.role == role; });
  assert(found != kinds.end());
  return *found;
}

std::vector<std::string_view> measuresIn(std::uint8_t MeasureKind::*place) {
  std::vector<const MeasureKind*> found;
  for (const MeasureKind& kind : measureKinds())
    if (kind.*place != 0) found.push_back(&kind);
  std::sort(found.begin(), found.end(),
            [&](const MeasureKind* a, const MeasureKind* b) { return a->*place < b->*place; });
  std::vector<std::string_view> names;
  for (const MeasureKind* const kind : found) names.push_back(kind->name);
  return names;
}

std::string measureTableMarkdown() {
  std::string text = "| measure | unit | better | words | definition |\n|---|---|---|---|---|\n";
  for (const MeasureKind& kind : measureKinds()) {
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
  ShownUnit shown = shownUnitOf(unit);
  // from 1 on as it is: 1.2 m, 2 J
  if (!(std::abs(value) < 1) && (unit == "m" || unit == "m/s" || unit == "J")) shown = {1, unit};
  std::string text = threeDigits(value * shown.per_si);
  if (!shown.name.empty() && unit != "rad") text += " ";
  return text.append(shown.name);
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

std::string rowText(const Measure& row) {
  if (!row.measured) return row.words;
  return measureText(row.name, row.value, row.unit) + (row.incomplete ? " (incomplete)" : "");
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
