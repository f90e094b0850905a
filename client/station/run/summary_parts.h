/// What the summary's text and its JSON share. Thread: any; pure.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "client/station/run/summary.h"

namespace needlelab {

using SummaryJson = nlohmann::ordered_json;

/// ns to µs.
inline double micro(std::int64_t ns) {
  return static_cast<double>(ns) * 1e-3;
}

/// Flags that were set at all, warnings or events: text → ticks.
inline SummaryJson flagCounts(const ServoStats& servo, bool warnings) {
  SummaryJson counts = SummaryJson::object();
  for (unsigned bit = 0; bit < servo.flag_ticks.size(); ++bit)
    if (servo.flag_ticks[bit] > 0 && !flagText(bit).empty() && isWarningFlag(bit) == warnings)
      counts[std::string(flagText(bit))] = servo.flag_ticks[bit];
  return counts;
}

/// null for a text that is empty or no JSON.
inline SummaryJson parsedOrNull(const std::string& text) {
  if (text.empty()) return nullptr;
  SummaryJson value = SummaryJson::parse(text, nullptr, false);
  return value.is_discarded() ? SummaryJson(nullptr) : value;
}

/// Of the samples that were stored; 0 when there are none.
inline double bytesPerSample(const StationSummary& summary) {
  const std::uint64_t stored = summary.writer.samples - summary.writer.samples_lost;
  return stored == 0 ? 0 : static_cast<double>(summary.writer.chunk_bytes) / static_cast<double>(stored);
}

}  // namespace needlelab
