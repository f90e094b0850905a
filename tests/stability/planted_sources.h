/// The force sources that counter-examples name: the shipped engine, and the reference with a planted defect.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "tests/support/reference/reference_source.h"

namespace needlelab::test {

/// Defects that random gestures find, by the name in a counter-example's `source`.
inline constexpr std::array<std::pair<std::string_view, Defect>, 4> kFindableDefects = {
    {{"literal eq 4", Defect::kLiteralEq4},
     {"turn leaves walls", Defect::kTurnLeavesWalls},
     {"friction by sign", Defect::kFrictionBySign},
     {"alpha without state", Defect::kAlphaWithoutState}}};

inline std::string sourceName(std::string_view defect) {
  return "reference engine, planted: " + std::string(defect);
}

/// "engine", or a name as above.
inline std::optional<ForceSourceFactory> sourceNamed(std::string_view name) {
  if (name == "engine") return engineSource();
  for (const auto& [text, defect] : kFindableDefects)
    if (name == sourceName(text)) return referenceSource(defect);
  return std::nullopt;
}

}  // namespace needlelab::test
