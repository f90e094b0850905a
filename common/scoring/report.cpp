#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/range.h"
#include "scoring/measures.h"

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
