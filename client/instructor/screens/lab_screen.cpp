#include "client/instructor/screens/screens.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <imgui/imgui_stdlib.h>

#include <fmt/core.h>

#include "client/instructor/screens/station_tile.h"
#include "client/instructor/screens/tile_grid.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

constexpr float kRail = 36;  // the rail's width, in space()

/// How many practise, and what is shown and chosen.
void showHead(LabState& lab) {
  ImGui::AlignTextToFramePadding();
  const auto counts = lab.overview.counts();
  for (const Need need : {Need::kPractising, Need::kWaiting, Need::kDone, Need::kOffline}) {
    const WithTextColour dim(kDimText);
    ImGui::TextUnformatted(
        fmt::format("{} {}", counts[static_cast<std::size_t>(need)], nameOf(need)).c_str());
    ImGui::SameLine(0, 2 * space());
  }
  ImGui::SameLine(0, 3 * space());
  ImGui::Checkbox("only online", &lab.filter.only_online);
  ImGui::SameLine(0, 3 * space());
  if (ImGui::Button("Choose all"))
    for (const StationTile* tile : lab.overview.tiles(lab.filter))
      if (tile->online) lab.chosen.insert(tile->station);
  ImGui::SameLine();
  if (!lab.chosen.empty() && ImGui::Button("Choose none")) lab.chosen.clear();
  ImGui::SameLine(0, 3 * space());
  ImGui::SetNextItemWidth(-1);
  ImGui::InputTextWithHint("##find", "find a station, a trainee or an exercise", &lab.filter.text);
}

void showCall(LabState& lab, const HelpCall& call, bool calls) {
  ImGui::PushID(call.station.c_str());
  const StationTile* const tile = lab.overview.find(call.station);
  conditionLine(calls && tile != nullptr ? conditionOf(*tile) : Condition::kUnknown,
                call.station + (call.trainee.empty() ? "" : " · " + call.trainee));
  {
    const WithFont small(Letters::kSmall);
    const WithTextColour colour(calls ? kText : kDimText);
    const char* const quiet = calls ? "" : call.seen ? ", seen" : ", put off";
    textBlock(fmt::format("{}, for {}{}", call.words, agoWords(lab.now_s() - call.since_s), quiet));
    if (ImGui::Button("Watch")) lab.open(call.station);
    if (calls) {
      ImGui::SameLine();
      if (ImGui::Button("Seen")) lab.overview.acknowledge(call.station);
      ImGui::SameLine();
      if (ImGui::Button("In 5 min")) lab.overview.snooze(call.station);
    }
  }
  ImGui::Spacing();
  ImGui::PopID();
}

/// Who needs help, and what was.
void showRail(LabState& lab, ImVec2 size_px) {
  beginPanel("help", {}, size_px.x, size_px.y);
  // a button of one may change the others
  std::vector<std::pair<HelpCall, bool>> shown;
  std::size_t calling = 0;
  for (const HelpCall* call : lab.overview.calls().open(lab.now_s())) {
    shown.emplace_back(*call, lab.overview.calls().calls(call->station, lab.now_s()));
    calling += shown.back().second ? 1 : 0;
  }
  {
    const WithFont heading(Letters::kHeading);
    conditionLine(calling > 0 ? Condition::kTrouble : Condition::kGood,
                  calling == 0 ? std::string("no one needs help")
                               : fmt::format("{} need{} help", calling, calling == 1 ? "s" : ""));
  }
  ImGui::Spacing();
  for (const auto& [call, calls] : shown) showCall(lab, call, calls);
  if (!lab.overview.calls().over().empty()) {
    ImGui::Separator();
    const WithFont small(Letters::kSmall);
    const WithTextColour dim(kDimText);
    ImGui::TextUnformatted("Earlier");
    for (const HelpCall& call : lab.overview.calls().over())
      textBlock(fmt::format("{} ago: {}{}, {}", agoWords(lab.now_s() - call.over_s), call.station,
                            call.trainee.empty() ? "" : " · " + call.trainee, call.words));
  }
  endPanel();
}

}  // namespace

void LabScreen::showTiles(LabState& lab, ImVec2 size_px) {
  const auto tiles = lab.overview.tiles(lab.filter);
  ImGui::BeginChild("tiles", size_px, false, ImGuiWindowFlags_NoBackground);
  if (tiles.empty()) {
    if (showEmpty("No station matches", "The filter hides every station.", "Show all")) lab.filter = {};
    ImGui::EndChild();
    return;
  }
  const float gap = 0.6F * space();
  const ImVec2 room = ImGui::GetContentRegionAvail(), least = leastTile_px();
  const TileGrid grid = tileGrid(static_cast<int>(tiles.size()), room.x, room.y, gap, least.x, least.y);
  const float scrollbar = grid.scrolls ? ImGui::GetStyle().ScrollbarSize : 0;
  const ImVec2 tile_px{grid.width_px - scrollbar / static_cast<float>(grid.columns), grid.height_px};
  ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {gap, gap});
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (i % static_cast<std::size_t>(grid.columns) != 0) ImGui::SameLine();
    // skips tiles outside the visible area
    const ImVec2 at = ImGui::GetCursorScreenPos();
    if (!ImGui::IsRectVisible(at, {at.x + tile_px.x, at.y + tile_px.y})) {
      ImGui::Dummy(tile_px);
      continue;
    }
    const std::string station = tiles[i]->station;
    const TileClick click = stationTile(lab, *tiles[i], tile_px);
    if (click == TileClick::kOpen) lab.open(station);
    if (click == TileClick::kChoose && lab.chosen.erase(station) == 0) lab.chosen.insert(station);
  }
  ImGui::PopStyleVar();
  ImGui::EndChild();
}

void LabScreen::show(LabState& lab) {
  showHead(lab);
  if (lab.overview.size() == 0) {
    showEmpty("No stations yet",
              "An administrator adds stations: needlelab-admin station add NAME. Then a station is started "
              "with the "
              "key that this made, and appears here by itself.");
    return;
  }
  const auto to = lab.addressees();
  const float gap = ImGui::GetStyle().ItemSpacing.y;
  const ImVec2 room = ImGui::GetContentRegionAvail();
  const float talk_px = to.empty() ? 0 : CommandPanel::height_px() + gap;
  const float rail_px = std::min(kRail * space(), 0.3F * room.x);
  showTiles(lab, {room.x - rail_px - ImGui::GetStyle().ItemSpacing.x, room.y - talk_px});
  ImGui::SameLine();
  showRail(lab, {rail_px, room.y - talk_px});
  if (!to.empty()) commands.show(lab, to);
}

}  // namespace needlelab
