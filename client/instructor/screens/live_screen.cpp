#include "client/instructor/screens/screens.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <fmt/core.h>

#include "client/instructor/model/live/session_scene.h"
#include "client/view/model/scene_view.h"
#include "client/view/theme.h"
#include "common/base/text/text.h"
#include "common/haptics/gate/force_gate.h"
#include "common/haptics/phase_words.h"

namespace needlelab {
namespace {

constexpr double kTrail_s = 8;

/// The station's state, with its problem if any.
void stationState(const LiveStation& live) {
  const auto& status = live.status();
  if (!status.online())
    return conditionLine(Condition::kAttention, "the station is not online: waiting for it");
  // Pausing the view does not hide a current fault, and a fault does not outlive its lesson.
  const std::uint32_t fault = live.shown().fault != 0 ? live.shown().fault : status.fault();
  if (fault != 0 && !status.session_id().empty())
    return conditionLine(Condition::kTrouble, std::string("FAULT: ") + faultText(static_cast<Fault>(fault)));
  if (!status.trouble().empty()) return conditionLine(Condition::kAttention, printable(status.trouble()));
  if (status.session_id().empty()) return conditionLine(Condition::kUnknown, "no lesson at the moment");
  conditionLine(Condition::kGood, isCapped(live.shown()) ? "capped" : phaseWord(live.shown().phase));
}

}  // namespace

void LiveScreen::showHead(LabState& lab) {
  LiveStation& live = *lab.live();
  const auto& d = live.info().description();
  {
    WithFont font(Letters::kHeading);
    const std::string who = d.trainee().empty() ? traineeName(live.status()) : traineeName(d);
    ImGui::TextUnformatted(printable(live.station() + (who.empty() ? "" : " · " + who)).c_str());
  }
  ImGui::SameLine(0, 2 * space());
  ImGui::TextUnformatted(lab.exerciseName(d.exercise_id()).c_str());
  ImGui::SameLine(0, 2 * space());
  stationState(live);
  // latency and losses, at the right end of the second line
  if (ImGui::Button(live.paused() ? "▶ Follow (Space)" : "❚❚ Pause (Space)"))
    live.paused() ? live.resume() : live.pause();
  ImGui::SameLine();
  ImGui::Checkbox("as the trainee sees it", &as_trainee_);
  ImGui::SameLine(0, 2 * space());
  const auto& stats = live.stats();
  // a long line is cut at its end, so the most important text comes first
  std::string words;
  if (live.approximate()) words = "cannot follow: total force only   ";
  if (live.paused())
    words += fmt::format("PAUSED {:.1f} s behind   ", live.trace().lastTime_s() - live.viewEnd_s());
  words += fmt::format(
      "{} frames, {} dropped   latency {:.0f} ms, {:.0f} ms to the screen (99 % within {:.0f} ms)",
      stats.frames(), stats.dropped() + lab.link().frames_dropped, stats.lastLatencyMs(),
      live.latency().last_ms(), live.latency().quantile_ms(0.99));
  if (const StationTile* const tile = lab.overview.find(live.station())) words += "   " + healthWords(*tile);
  WithTextColour dim(live.paused() ? kYellow : kDimText);
  textLine(words);
}

void LiveScreen::showAlarms(LabState& lab) {
  const StationTile* const tile = lab.overview.find(lab.live()->station());
  if (tile == nullptr || (tile->alarms.empty() && !tile->calls)) return;
  if (tile->calls) {
    if (ImGui::Button("Seen")) lab.overview.acknowledge(tile->station);
    ImGui::SameLine(0, 2 * space());
  }
  if (tile->hand_raised) {
    conditionLine(Condition::kAttention, "the trainee asks for help");
    ImGui::SameLine(0, 3 * space());
  }
  for (const TileAlarm& alarm : tile->alarms) {
    conditionLine(alarm.danger ? Condition::kTrouble : Condition::kAttention,
                  alarm.words + (alarm.now ? "" : " (over)"));
    ImGui::SameLine(0, 3 * space());
  }
  ImGui::NewLine();
}

void LiveScreen::showScene(LabState& lab, ImVec2 size_px) {
  const LiveStation& live = *lab.live();
  std::vector<TipTrail> trails;
  if (!as_trainee_) trails.push_back(trailOf(live.trace(), live.viewEnd_s(), kTrail_s, kSkyBlue));
  pane_.show("live scene", live.scene().view, live.shown(), lab.planNow(),
             as_trainee_ ? AidSet(lab.aidsNow()) : allAidSet(), size_px, {}, std::move(trails));
}

void LiveScreen::showPlots(LiveStation& live, std::span<const PlotRequirement> requirements, ImVec2 size_px) {
  ImGui::BeginChild(
      "plots", size_px, false,
      ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse | ImGuiWindowFlags_NoBackground);
  choosePlots(plots);
  const double end_s = live.viewEnd_s();
  // a new lesson fills the plots from the left
  const double from_s = std::max(end_s - live.span_s(), live.trace().firstTime_s());
  const auto result =
      gesturePlots("live plots", plots, live.trace(), live.scene().view.get(), from_s, from_s + live.span_s(),
                   live.paused() ? std::optional<double>(end_s) : std::nullopt, {0, 0}, requirements);
  if (result.scrolled != 0) live.setSpan(live.span_s() * std::pow(1.25, -result.scrolled));
  if (result.dragged != 0) live.scrollTo(end_s - result.dragged);
  if (result.clicked_x) live.scrollTo(*result.clicked_x);
  ImGui::EndChild();
}

void LiveScreen::show(LabState& lab) {
  if (lab.live() == nullptr) {
    if (showEmpty("No station is being watched", "Choose a station in the lab: click its tile.",
                  "To the lab"))
      lab.screen = WindowScreen::kLab;
    return;
  }
  LiveStation& live = *lab.live();
  showHead(lab);
  showAlarms(lab);
  const ImVec2 room = ImGui::GetContentRegionAvail();
  const float talk_px = CommandPanel::height_px();
  const float height = room.y - talk_px - ImGui::GetStyle().ItemSpacing.y;
  if (live.trace().empty()) {
    ImGui::BeginChild("waiting", {0, height}, false, ImGuiWindowFlags_NoBackground);
    if (!live.scene().why.empty())
      showEmpty("The lesson cannot be shown", live.scene().why);
    else
      showEmpty("Waiting for the first samples",
                live.status().online() ? "The station is online; its picture appears with the next lesson."
                                       : "The station is not online. Its picture appears when it is back.");
    ImGui::EndChild();
  } else {
    showScene(lab, {room.x * 0.52F, height});
    ImGui::SameLine();
    showPlots(live, lab.requirementsNow(), {0, height});
  }
  commands.show(lab, lab.commanded());
}

}  // namespace needlelab
