#include "client/instructor/screens/replay_screen.h"

#include <imgui/imgui_stdlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "client/instructor/screens/desk_frame.h"
#include "client/instructor/screens/time_line.h"
#include "client/view/model/axis_ticks.h"
#include "client/view/theme.h"
#include "common/base/text.h"

namespace needlelab {

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
  if (ImGui::BeginCombo("##speed", formatted("%.3g× speed", player.speed()).c_str())) {
    for (const double speed : kSpeeds)
      if (ImGui::Selectable(formatted("%.3g×", speed).c_str(), speed == player.speed()))
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
  ImGui::TextUnformatted(formatted("%s of %s", clockText(at, 1).c_str(),
                                   clockText(player.last_s() - player.first_s(), 1).c_str())
                             .c_str());
}

void ReplayScreen::showHead(Desk& desk) {
  const StoredGesture& gesture = *desk.bench.first();
  {
    WithFont font(Letters::kHeading);
    ImGui::TextUnformatted(gesture.title().c_str());
  }
  if (gesture.info.has_passed()) {
    ImGui::SameLine(0, 2 * space());
    conditionLine(gesture.info.passed() ? Condition::kGood : Condition::kTrouble,
                  gesture.info.passed() ? "passed" : "not passed");
  }
  if (!gesture.notes.empty()) {
    ImGui::SameLine(0, 2 * space());
    WithTextColour dim(kOrange);
    textLine(gesture.notes.front() + (gesture.notes.size() > 1
                                          ? formatted(" (and %zu more)", gesture.notes.size() - 1)
                                          : std::string()));
  }
}

void ReplayScreen::showPlayer(Desk& desk) {
  playerButtons(desk.bench.player);
  ImGui::SameLine(0, 2 * space());
  ImGui::Checkbox("whole", &whole_);
  ImGui::SameLine(0, 2 * space());
  if (std::exchange(focus_remark_, false)) ImGui::SetKeyboardFocusHere();
  ImGui::SetNextItemWidth(std::max(60.0F, ImGui::GetContentRegionAvail().x - 12 * space()));
  bool go = ImGui::InputTextWithHint("##remark", "remark at this moment", &remark_,
                                     ImGuiInputTextFlags_EnterReturnsTrue);
  ImGui::SameLine();
  go |= ImGui::Button("Annotate");
  if (go && !remark_.empty()) {
    desk.annotate(remark_);
    remark_.clear();
  }
  timeLine(desk.bench.player, *desk.bench.first(), desk.bench.remarks(), 5 * space());
}

void ReplayScreen::show(Desk& desk) {
  showWork(desk);
  if (!desk.bench.first()) {
    if (desk.bench.busy()) return;
    if (showEmpty(desk.bench.trouble().empty() ? "No session is loaded" : "The session could not be loaded",
                  desk.bench.trouble().empty() ? "Choose one in the list of sessions." : desk.bench.trouble(),
                  "To the sessions"))
      desk.screen = DeskScreen::kSessions;
    return;
  }
  const StoredGesture& gesture = *desk.bench.first();
  showHead(desk);
  if (gesture.trace.empty()) {
    showEmpty("This recording has no samples",
              "It was opened and closed without a tick, or nothing could be read.");
    return;
  }
  ReplayPlayer& player = desk.bench.player;
  const ImVec2 room = ImGui::GetContentRegionAvail();
  const float height = room.y - 11.5F * space();
  const double at_s = player.at_s();
  pane_.show("replay scene", gesture.scene.view, gesture.trace.at(at_s), allAidSet(),
             {room.x * 0.48F, height}, {}, {trailOf(gesture.trace, at_s, 8, kFirstGesture)});
  ImGui::SameLine();
  ImGui::BeginChild(
      "replay plots", {0, height}, false,
      ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse | ImGuiWindowFlags_NoBackground);
  choosePlots(plots);
  const double from_s = whole_ ? player.first_s() : at_s - 5, to_s = whole_ ? player.last_s() : at_s + 5;
  const auto result =
      gesturePlots("plots", plots, gesture.trace, gesture.scene.view.get(), from_s, to_s, at_s, {0, 0});
  if (result.clicked_x) player.seek(*result.clicked_x);
  ImGui::EndChild();
  showPlayer(desk);
}

}  // namespace needlelab
