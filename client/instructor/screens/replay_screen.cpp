#include "client/instructor/screens/screens.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>

#include <imgui/imgui_stdlib.h>

#include <fmt/core.h>

#include "client/view/input_queue.h"
#include "client/view/model/plot.h"
#include "client/view/theme.h"
#include "common/base/text/text.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/measures/syringe_events.h"

namespace needlelab {
namespace {

struct LineMark {
  double at_s;
  std::string sign, words;
  Rgb colour;
};

std::vector<LineMark> marksOf(const StoredGesture& gesture, const std::vector<pb::Annotation>& remarks) {
  std::vector<LineMark> marks;
  for (const TraceEvent& event : gesture.trace.events()) {
    if (event.kind == TraceEvent::Kind::kRemark || event.kind == TraceEvent::Kind::kLayerChange ||
        event.kind == TraceEvent::Kind::kTurn || event.kind == TraceEvent::Kind::kStop)
      continue;
    const bool bad = event.kind == TraceEvent::Kind::kFault || event.kind == TraceEvent::Kind::kGap ||
                     event.kind == TraceEvent::Kind::kBoneContact ||
                     event.kind == TraceEvent::Kind::kHubContact || event.kind == TraceEvent::Kind::kHazard;
    marks.push_back(
        {event.time_s, std::string(signOf(event.kind)), wordsOf(event), bad ? kVermillion : kDimText});
  }
  for (const pb::SyringeEvent& event : gesture.events)
    marks.push_back({gesture.timeOfTick(event.begin_tick()),
                     event.kind() == pb::SyringeEvent::INJECTION ? "▼" : "△", eventText(event),
                     kBluishGreen});
  for (const pb::Annotation& remark : remarks)
    marks.push_back({gesture.timeOfTick(remark.tick()), "✎",
                     printable(remark.author()) + ": " + printable(remark.text()), kYellow});
  return marks;
}

void timeLine(ReplayPlayer& player, const StoredGesture& gesture, const std::vector<pb::Annotation>& remarks,
              float height_px) {
  const ImVec2 low = ImGui::GetCursorScreenPos();
  const float width = ImGui::GetContentRegionAvail().x;
  ImGui::InvisibleButton("time line", {width, height_px});
  const bool hovered = ImGui::IsItemHovered(), active = ImGui::IsItemActive();
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const double length_s = std::max(1e-3, player.last_s() - player.first_s());
  const auto x = [&](double at_s) {
    return low.x + static_cast<float>((at_s - player.first_s()) / length_s) * width;
  };
  const auto timeAt = [&](float px) {
    return player.first_s() + static_cast<double>((px - low.x) / width) * length_s;
  };
  // line, loop, ticks
  const float middle = low.y + height_px * 0.55F;
  list.AddRectFilled({low.x, low.y}, {low.x + width, low.y + height_px}, packed(kPanelGrey), 4);
  if (player.loop())
    list.AddRectFilled({x(player.loop()->from_s), low.y}, {x(player.loop()->to_s), low.y + height_px},
                       packed(kSkyBlue, 0.28F));
  list.AddLine({low.x, middle}, {low.x + width, middle}, packed(kLineGrey), 2);
  const AxisTicks ticks = axisTicks(0, length_s, std::max(2, static_cast<int>(width / 90)), false);
  for (const double at : ticks.at) {
    const float px = x(player.first_s() + at);
    list.AddLine({px, middle - 3}, {px, middle + 3}, packed(kDimText));
    if (px + 5 * space() > low.x + width) continue;  // too narrow for its number
    list.AddText(fontOf(Letters::kSmall), fontOf(Letters::kSmall)->FontSize, {px + 3, middle + 4},
                 packed(kDimText), clockText(at, length_s < 20 ? 1 : 0).c_str());
  }
  // marks, with the text of the nearest
  const float mouse = ImGui::GetIO().MousePos.x;
  const LineMark* near = nullptr;
  float least = 8;
  const auto marks = marksOf(gesture, remarks);
  for (const LineMark& mark : marks) {
    const float px = x(mark.at_s);
    list.AddText({px - 5, low.y + 1}, packed(mark.colour), mark.sign.c_str());
    if (hovered && std::abs(px - mouse) < least) {
      least = std::abs(px - mouse);
      near = &mark;
    }
  }
  if (near != nullptr)
    ImGui::SetTooltip("%s  %s", clockText(near->at_s - player.first_s(), 1).c_str(), near->words.c_str());
  const float here = x(player.at_s());
  list.AddLine({here, low.y}, {here, low.y + height_px}, packed(kWhite), 2);
  list.AddTriangleFilled({here - 6, low.y}, {here + 6, low.y}, {here, low.y + 8}, packed(kWhite));
  if (!active) return;
  if (!ImGui::GetIO().KeyShift) return player.seek(timeAt(mouse));
  const double begun = timeAt(ImGui::GetIO().MouseClickedPos[0].x), now = timeAt(mouse);
  player.setLoop(ReplayLoop{std::min(begun, now), std::max(begun, now)});
}

void playerButtons(ReplayPlayer& player) {
  if (ImGui::Button("❙◀")) player.seek(player.loop() ? player.loop()->from_s : player.first_s());
  ImGui::SameLine();
  if (ImGui::Button("◀ step")) player.step(-1);
  ImGui::SameLine();
  if (ImGui::Button(player.playing() ? "❚❚ Pause" : "▶ Play")) player.toggle();
  ImGui::SameLine();
  if (ImGui::Button("step ▶")) player.step(1);
  ImGui::SameLine(0, 2 * space());
  constexpr std::array kSpeeds = {0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0};
  ImGui::SetNextItemWidth(15 * space());
  if (ImGui::BeginCombo("##speed", fmt::format("{:.3g}× speed", player.speed()).c_str())) {
    for (const double speed : kSpeeds)
      if (ImGui::Selectable(fmt::format("{:.3g}×", speed).c_str(), speed == player.speed()))
        player.setSpeed(speed);
    ImGui::EndCombo();
  }
  ImGui::SameLine(0, 2 * space());
  if (!player.loop()) {
    if (ImGui::Button("Loop 2 s from here")) player.setLoop(ReplayLoop{player.at_s(), player.at_s() + 2});
  } else if (ImGui::Button("End the loop")) {
    player.setLoop({});
  }
  ImGui::SameLine(0, 2 * space());
  const double at = player.at_s() - player.first_s();
  ImGui::TextUnformatted(
      fmt::format("{} of {}", clockText(at, 1), clockText(player.last_s() - player.first_s(), 1)).c_str());
}

}  // namespace

void ReplayScreen::showHead(LabState& lab) {
  const StoredGesture& gesture = *lab.analysis.first();
  {
    WithFont font(Letters::kHeading);
    ImGui::TextUnformatted(gesture.title().c_str());
  }
  if (gesture.info.has_passed()) {
    ImGui::SameLine(0, 2 * space());
    conditionLine(gesture.info.passed() ? Condition::kGood : Condition::kTrouble,
                  verdictName(gesture.info.passed()));
  }
  if (!gesture.notes.empty()) {
    ImGui::SameLine(0, 2 * space());
    WithTextColour dim(kOrange);
    textLine(gesture.notes.front() + (gesture.notes.size() > 1
                                          ? fmt::format(" (and {} more)", gesture.notes.size() - 1)
                                          : std::string()));
  }
}

void ReplayScreen::showPlayer(LabState& lab) {
  playerButtons(lab.analysis.player);
  ImGui::SameLine(0, 2 * space());
  ImGui::Checkbox("whole", &whole_);
  ImGui::SameLine(0, 2 * space());
  if (std::exchange(focus_remark_, false)) focusNextField();
  ImGui::SetNextItemWidth(std::max(60.0F, ImGui::GetContentRegionAvail().x - 12 * space()));
  bool go = ImGui::InputTextWithHint("##remark", "remark at this moment", &remark_,
                                     ImGuiInputTextFlags_EnterReturnsTrue);
  ImGui::SameLine();
  go |= ImGui::Button("Annotate");
  if (go && !remark_.empty() && lab.annotate(remark_)) remark_.clear();
  timeLine(lab.analysis.player, *lab.analysis.first(), lab.analysis.remarks(), 5 * space());
}

void ReplayScreen::show(LabState& lab) {
  showWork(lab);
  if (!lab.analysis.first()) {
    if (lab.analysis.busy()) return;
    const std::string trouble = lab.analysis.troubleOf(AnalysisJob::kLoad);
    if (showEmpty(trouble.empty() ? "No session is loaded" : "The session could not be loaded",
                  trouble.empty() ? "Choose one in the list of sessions." : trouble, "To the sessions"))
      lab.screen = WindowScreen::kSessions;
    return;
  }
  const StoredGesture& gesture = *lab.analysis.first();
  showHead(lab);
  if (gesture.trace.empty()) {
    showEmpty("This recording has no samples",
              "It was opened and closed without a tick, or nothing could be read.");
    return;
  }
  ReplayPlayer& player = lab.analysis.player;
  const ImVec2 room = ImGui::GetContentRegionAvail();
  const float height = room.y - 11.5F * space();
  const double at_s = player.at_s();
  pane_.show("replay scene", gesture.scene.view, gesture.trace.at(at_s), gesture.planView(), allAidSet(),
             {room.x * 0.48F, height}, {}, {trailOf(gesture.trace, at_s, 8, kFirstGesture)});
  ImGui::SameLine();
  ImGui::BeginChild(
      "replay plots", {0, height}, false,
      ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse | ImGuiWindowFlags_NoBackground);
  choosePlots(plots);
  const double from_s = whole_ ? player.first_s() : at_s - 5, to_s = whole_ ? player.last_s() : at_s + 5;
  const auto result = gesturePlots("plots", plots, gesture.trace, gesture.scene.view.get(), from_s, to_s,
                                   at_s, {0, 0}, gesture.requirements);
  if (result.clicked_x) player.seek(*result.clicked_x);
  ImGui::EndChild();
  showPlayer(lab);
}

}  // namespace needlelab
