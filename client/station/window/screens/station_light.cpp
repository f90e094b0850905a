#include "client/station/window/screens/station_light.h"

#include <fmt/core.h>
#include <imgui/imgui.h>

#include <algorithm>
#include <numbers>

#include "client/view/theme.h"

namespace needlelab {

StationFact serverFact(const std::string& server) {
  const bool waits = server.starts_with("server away") || server.starts_with("server has no room") ||
                     server == "server refuses";
  return {waits ? Condition::kAttention : Condition::kGood, server};
}

std::vector<StationFact> lessonFacts(const BoardState& state, const LessonBeginning& beginning,
                                     std::uint64_t dropped, double alpha_rad) {
  const LessonStatus& s = state.status;
  const double missed_share =
      s.time_s > 0 ? static_cast<double>(s.missed_ticks) / (s.time_s * beginning.rate_hz) : 0;
  std::vector<StationFact> facts;
  facts.push_back({missed_share > 0.01    ? Condition::kTrouble
                   : missed_share > 0.001 ? Condition::kAttention
                                          : Condition::kGood,
                   fmt::format("loop {:.0f} Hz: 99 % within {:.0f} µs, {} missed", beginning.rate_hz,
                               1e-3 * static_cast<double>(s.wakeup.p99_ns), s.missed_ticks)});
  const bool recording = s.spool.empty() || s.spool == "recording";
  facts.push_back({recording ? Condition::kGood : Condition::kTrouble, recording ? "recording" : s.spool});
  if (!s.server.empty()) facts.push_back(serverFact(s.server));
  if (!s.room.empty()) facts.push_back({Condition::kTrouble, s.room});
  if (dropped > 0)
    facts.push_back({Condition::kAttention,
                     fmt::format("this picture left out {} samples; the recording has them", dropped)});
  if (!state.aids_by.empty()) facts.push_back({Condition::kUnknown, state.aids_by + " chose what is shown"});
  facts.push_back(
      {Condition::kUnknown, fmt::format("tilt limit α {:.0f}°", alpha_rad * 180 / std::numbers::pi)});
  for (const std::string& note : beginning.device_notes) facts.push_back({Condition::kUnknown, note});
  return facts;
}

Condition lightOf(std::span<const StationFact> facts) {
  Condition worst = Condition::kGood;
  for (const StationFact& fact : facts) worst = std::max(worst, fact.condition);
  return worst;
}

const char* lightText(Condition light) {
  return light <= Condition::kGood ? "Station OK" : "Station: look";
}

bool stationLight(Condition light) {
  ImGui::BeginGroup();
  conditionLine(light, lightText(light));
  ImGui::SameLine();
  keyHint("I", "more");
  ImGui::EndGroup();
  return ImGui::IsItemClicked();
}

void showFacts(std::span<const StationFact> facts) {
  for (const StationFact& fact : facts) conditionLine(fact.condition, fact.words);
}

}  // namespace needlelab
