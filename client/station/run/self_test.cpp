#include "client/station/run/self_test.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "client/station/run/report_output.h"
#include "common/base/text.h"

namespace needlelab {

const char* verdictText(Verdict verdict) {
  switch (verdict) {
    case Verdict::kOk:
      return "OK";
    case Verdict::kWarning:
      return "WARNING";
    case Verdict::kFailed:
      return "FAILED";
    case Verdict::kNotChecked:
      return "not checked";
  }
  return "?";
}

std::string selfTestText(const std::vector<Check>& checks) {
  constexpr std::size_t kVerdict = 13;
  std::size_t name = 0;
  for (const Check& check : checks) name = std::max(name, columnsOf(check.name) + 2);
  const std::size_t indent = name + kVerdict;
  std::string text;
  std::size_t count[4] = {};
  for (const Check& check : checks) {
    ++count[static_cast<std::size_t>(check.verdict)];
    std::string found = check.found;
    if (!check.limit.empty()) found += " (" + check.limit + ")";
    text += padded(check.name, name) + padded(verdictText(check.verdict), kVerdict);
    text += found.empty() ? "\n" : wrapped(found, indent).substr(indent);
    if (!check.advice.empty()) text += wrapped("→ " + check.advice, indent);
  }
  text += formatted("\n%zu checks: %zu OK, %zu warnings, %zu failed, %zu not made\n", checks.size(), count[0],
                    count[1], count[2], count[3]);
  if (count[static_cast<std::size_t>(Verdict::kFailed)] > 0)
    text += "Do not begin a lesson before what FAILED is put right.\n";
  else if (count[static_cast<std::size_t>(Verdict::kWarning)] > 0)
    text += "Lessons can begin; the warnings say what would make them better.\n";
  else
    text += "Lessons can begin.\n";
  return text;
}

std::string selfTestJson(const std::vector<Check>& checks) {
  auto rows = nlohmann::ordered_json::array();
  for (const Check& check : checks) {
    nlohmann::ordered_json row = {{"check", check.name}, {"verdict", verdictText(check.verdict)}};
    row["value"] = check.value && std::isfinite(*check.value) ? nlohmann::ordered_json(*check.value)
                                                              : nlohmann::ordered_json(nullptr);
    row["unit"] = check.unit;
    row["found"] = check.found;
    row["limit"] = check.limit;
    row["advice"] = check.advice;
    rows.push_back(row);
  }
  return reportJson(rows);
}

}  // namespace needlelab
