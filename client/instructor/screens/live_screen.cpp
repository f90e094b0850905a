#include "client/instructor/screens/live_screen.h"

#include <algorithm>
#include <cmath>

#include "client/instructor/screens/desk_frame.h"
#include "client/view/theme.h"
#include "common/base/text.h"
#include "common/haptics/force_gate.h"

namespace needlelab {
namespace {

constexpr double kTrail_s = 8;

/// What is wrong at the station itself, if anything.
void stationState(const LiveStation& live) {
  const auto& status = live.status();
  if (!status.online())
    return conditionLine(Condition::kAttention, "the station is not online: waiting for it");
  if (live.shown().fault != 0)
    return conditionLine(Condition::kTrouble,
                         std::string("FAULT: ") + faultText(static_cast<Fault>(live.shown().fault)));
  if (!status.trouble().empty()) return conditionLine(Condition::kAttention, printable(status.trouble()));
  if (status.session_id().empty()) return conditionLine(Condition::kUnknown, "no lesson at the moment");
  conditionLine(Condition::kGood, phaseWord(live.shown().phase));
}

}  // namespace

void LiveScreen::showHead(Desk& desk) {
  LiveStation& live = *desk.live();
  const auto& d = live.info().description();
  {
    WithFont font(Letters::kHeading);
    const std::string who = d.trainee().empty() ? live.status().trainee() : d.trainee();
    ImGui::TextUnformatted(printable(live.station() + (who.empty() ? "" : " · " + who)).c_str());
  }
  ImGui::SameLine(0, 2 * space());
  ImGui::TextUnformatted(printable(d.exercise_id()).c_str());
  ImGui::SameLine(0, 2 * space());
  stationState(live);
  // how late, how complete: at the right end of the second line
  if (ImGui::Button(live.paused() ? "▶ Follow (Space)" : "❚❚ Pause (Space)"))
    live.paused() ? live.resume() : live.pause();
  ImGui::SameLine();
  ImGui::Checkbox("as the trainee sees it", &as_trainee_);
  ImGui::SameLine(0, 2 * space());
  const auto& stats = live.stats();
  // what is cut when the line gets long stands last
  std::string words;
  if (live.paused())
    words = formatted("PAUSED %.1f s behind   ", live.trace().lastTime_s() - live.viewEnd_s());
  words += formatted("latency %.0f ms to here, %.0f ms to the screen (p99 %.0f)   ", stats.lastLatencyMs(),
                     live.latency().last_ms(), live.latency().quantile_ms(0.99)) +
           formatted("%llu frames, %llu dropped", static_cast<unsigned long long>(stats.frames()),
                     static_cast<unsigned long long>(stats.dropped() + desk.link().frames_dropped));
  if (live.approximate()) words += "   forces by effect are approximate until the needle is out";
  WithTextColour dim(live.paused() ? kYellow : kDimText);
  textLine(words);
}

void LiveScreen::showScene(LiveStation& live, const AidSet& allowed, ImVec2 size_px) {
  std::vector<TipTrail> trails;
  if (!as_trainee_) trails.push_back(trailOf(live.trace(), live.viewEnd_s(), kTrail_s, kSkyBlue));
  pane_.show("live scene", live.scene().view, live.shown(), as_trainee_ ? allowed : allAidSet(), size_px, {},
             std::move(trails));
}

void LiveScreen::showPlots(LiveStation& live, ImVec2 size_px) {
  ImGui::BeginChild(
      "plots", size_px, false,
      ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse | ImGuiWindowFlags_NoBackground);
  choosePlots(plots);
  const double end_s = live.viewEnd_s();
  // a lesson that has just begun fills the plots from the left
  const double from_s = std::max(end_s - live.span_s(), live.trace().firstTime_s());
  const auto result =
      gesturePlots("live plots", plots, live.trace(), live.scene().view.get(), from_s, from_s + live.span_s(),
                   live.paused() ? std::optional<double>(end_s) : std::nullopt, {0, 0});
  if (result.scrolled != 0) live.setSpan(live.span_s() * std::pow(1.25, -result.scrolled));
  if (result.dragged != 0) live.scrollTo(end_s - result.dragged);
  if (result.clicked_x) live.scrollTo(*result.clicked_x);
  ImGui::EndChild();
}

void LiveScreen::show(Desk& desk) {
  if (desk.live() == nullptr) {
    if (showEmpty("Nobody is looked over", "Choose a station in the lab: click its tile.", "To the lab"))
      desk.screen = DeskScreen::kLab;
    return;
  }
  LiveStation& live = *desk.live();
  showHead(desk);
  const ImVec2 room = ImGui::GetContentRegionAvail();
  const float talk_px = 10.5F * space();
  const float height = room.y - talk_px - ImGui::GetStyle().ItemSpacing.y;
  if (live.trace().empty()) {
    ImGui::BeginChild("waiting", {0, height}, false, ImGuiWindowFlags_NoBackground);
    if (!live.scene().why.empty())
      showEmpty("The lesson cannot be shown", live.scene().why);
    else
      showEmpty("Waiting for the first samples",
                live.status().online() ? "The station is online; its picture comes with the next lesson."
                                       : "The station is not online. Its picture comes when it is back.");
    ImGui::EndChild();
  } else {
    showScene(live, AidSet(desk.aidsNow()), {room.x * 0.52F, height});
    ImGui::SameLine();
    showPlots(live, {0, height});
  }
  talk.show(desk);
}

}  // namespace needlelab
