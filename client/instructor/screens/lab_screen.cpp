#include "client/instructor/screens/lab_screen.h"

#include <imgui/imgui_stdlib.h>

#include <algorithm>
#include <array>
#include <utility>

#include "client/instructor/screens/desk_frame.h"
#include "client/instructor/screens/station_tile.h"
#include "client/view/theme.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

/// How many need what: the answer to "who needs me?" before any tile is read.
void showCounts(const Desk& desk) {
  ImGui::AlignTextToFramePadding();
  const auto counts = desk.overview.counts();
  std::size_t help = 0;
  for (std::size_t i = 0; i < kNeedCount; ++i)
    if (needsHelp(static_cast<Need>(i))) help += counts[i];
  conditionLine(help > 0 ? Condition::kTrouble : Condition::kGood,
                help == 0 ? std::string("nobody needs help")
                          : formatted("%zu need%s help", help, help == 1 ? "s" : ""));
  for (const Need need : {Need::kPractising, Need::kWaiting, Need::kDone, Need::kOffline}) {
    ImGui::SameLine(0, 2 * space());
    WithTextColour dim(kDimText);
    ImGui::TextUnformatted(
        formatted("%zu %s", counts[static_cast<std::size_t>(need)], std::string(wordOf(need)).c_str())
            .c_str());
  }
}

void showChoices(Desk& desk) {
  ImGui::SameLine(0, 3 * space());
  ImGui::Checkbox("only who needs help", &desk.filter.only_help);
  ImGui::SameLine();
  ImGui::Checkbox("only online", &desk.filter.only_online);
  ImGui::SameLine();
  constexpr std::array<std::pair<TileOrder, const char*>, 4> kOrders = {
      {{TileOrder::kNeed, "by need"},
       {TileOrder::kName, "by name"},
       {TileOrder::kTrainee, "by trainee"},
       {TileOrder::kPeakForce, "by force"}}};
  ImGui::SetNextItemWidth(14 * space());
  const auto now =
      std::find_if(kOrders.begin(), kOrders.end(), [&](const auto& o) { return o.first == desk.order; });
  if (ImGui::BeginCombo("##order", now->second)) {
    for (const auto& [order, word] : kOrders)
      if (ImGui::Selectable(word, order == desk.order)) desk.order = order;
    ImGui::EndCombo();
  }
  ImGui::SameLine();
  ImGui::SetNextItemWidth(-1);
  ImGui::InputTextWithHint("##find", "find a name", &desk.filter.text);
}

}  // namespace

void showLab(Desk& desk) {
  showCounts(desk);
  showChoices(desk);
  const auto tiles = desk.overview.tiles(desk.order, desk.filter);
  if (desk.overview.size() == 0) {
    showEmpty("No station is known yet",
              "An administrator adds stations: needlelab-admin station add NAME. Then a station is started "
              "with the "
              "key that this made, and appears here by itself.");
    return;
  }
  if (tiles.empty()) {
    if (showEmpty("No station matches", "The filter hides all of them.", "Show all")) desk.filter = {};
    return;
  }
  ImGui::BeginChild("tiles", {0, 0}, false, ImGuiWindowFlags_NoBackground);
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  const float room = ImGui::GetContentRegionAvail().x;
  const int columns = std::max(1, static_cast<int>(room / (30 * space())));
  const float width = (room - gap * static_cast<float>(columns - 1)) / static_cast<float>(columns);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (i % static_cast<std::size_t>(columns) != 0) ImGui::SameLine();
    // what is scrolled away costs its place only
    const ImVec2 at = ImGui::GetCursorScreenPos();
    if (!ImGui::IsRectVisible(at, {at.x + width, at.y + tileHeight_px()})) {
      ImGui::Dummy({width, tileHeight_px()});
      continue;
    }
    if (stationTile(*tiles[i], width)) desk.open(tiles[i]->station);
  }
  ImGui::EndChild();
}

}  // namespace needlelab
