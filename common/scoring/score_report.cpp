#include <algorithm>
#include <nlohmann/json.hpp>

#include "common/base/range.h"
#include "common/scoring/measures.h"

namespace needlelab {
namespace {

/// Columns that a terminal shows: bytes that do not continue a UTF-8 character.
std::size_t widthOf(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

}  // namespace

std::string scoreJson(std::span<const Measure> measures) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const Measure& measure : measures) {
    nlohmann::ordered_json row;
    row["measure"] = measure.name;
    row["value"] = measure.measured ? nlohmann::ordered_json(measure.value) : nlohmann::ordered_json(nullptr);
    row["unit"] = measure.unit;
    if (measure.min) row["min"] = *measure.min;
    if (measure.max) row["max"] = *measure.max;
    if (measure.passed) row["passed"] = *measure.passed;
    row["words"] = measure.words;
    rows.push_back(std::move(row));
  }
  return rows.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

Result<std::vector<Measure>> parseScore(const std::string& json) {
  const auto rows = nlohmann::json::parse(json, nullptr, false);
  const Error wrong{ErrorCode::kCorrupt, "a stored score is not a list of measures"};
  if (!rows.is_array()) return wrong;
  std::vector<Measure> measures;
  const auto limit = [](const nlohmann::json& row, const char* key) {
    const auto found = row.find(key);
    return found != row.end() && found->is_number() ? std::optional(found->get<double>()) : std::nullopt;
  };
  for (const auto& row : rows) {
    if (!row.is_object() || !row.contains("measure") || !row["measure"].is_string() || !row.contains("value"))
      return wrong;
    Measure measure;
    measure.name = row["measure"].get<std::string>();
    measure.measured = row["value"].is_number();
    if (measure.measured) measure.value = row["value"].get<double>();
    if (row.contains("unit") && row["unit"].is_string()) measure.unit = row["unit"].get<std::string>();
    if (row.contains("words") && row["words"].is_string()) measure.words = row["words"].get<std::string>();
    measure.min = limit(row, "min");
    measure.max = limit(row, "max");
    if (row.contains("passed") && row["passed"].is_boolean()) measure.passed = row["passed"].get<bool>();
    measures.push_back(std::move(measure));
  }
  return measures;
}

std::string scoreText(std::span<const Measure> measures) {
  // what was required first, then all the rest
  std::vector<const Measure*> order;
  for (const Measure& measure : measures) {
    if (measure.passed) order.push_back(&measure);
  }
  const std::size_t required = order.size();
  for (const Measure& measure : measures) {
    if (!measure.passed) order.push_back(&measure);
  }

  std::size_t name_width = 0, value_width = 0;
  const auto valueOf = [](const Measure& m) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.6g", m.value);
    return m.measured ? std::string(text.data()) + (m.unit.empty() ? "" : " " + m.unit) : std::string("-");
  };
  for (const Measure* measure : order) {
    name_width = std::max(name_width, measure->name.size());
    value_width = std::max(value_width, widthOf(valueOf(*measure)));
  }

  std::string text;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Measure& measure = *order[i];
    if (i == required && required > 0) text += "\n";
    const std::string value = valueOf(measure);
    const char* const mark = !measure.passed ? "      " : *measure.passed ? "pass  " : "FAIL  ";
    text += mark + measure.name + std::string(name_width - measure.name.size() + 2, ' ') +
            std::string(value_width - widthOf(value), ' ') + value + "  " + measure.words + "\n";
  }
  return text;
}

}  // namespace needlelab
