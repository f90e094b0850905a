#include "client/instructor/screens/screens.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include <imgui/imgui_stdlib.h>

#include <fmt/core.h>

#include "client/view/plots.h"
#include "client/view/theme.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

float tileHeight_px() {
  return 14.6F * space();
}

/// Draws the tile's lines in small letters into the open child window.
void tileLines(const LabState& lab, const StationTile& tile, float inner, float height_px) {
  WithFont small(Letters::kSmall);
  {
    WithTextColour dim(tile.stale || !tile.online ? kDimText : kText);
    textLine(lessonWords(tile, lab.exerciseName(tile.exercise)), inner);
    const std::string state = needsHelp(tile.need) ? tile.why : depthWords(tile);
    if (!state.empty()) textLine(state, inner);
  }
  // current force with its limit and peak, and the last seconds as a line
  if (tile.online && !tile.session_id.empty()) {
    const std::string words = forceWords(tile);
    // wide enough for its text and the sign for excessive force
    const float needed = ImGui::CalcTextSize(words.c_str()).x + ImGui::GetFontSize() + 2 * space();
    const float bar = std::min(inner, std::max(inner * 0.58F, needed));
    levelBar(tile.force_N / tile.force_limit_N, words, kSkyBlue, bar);
    if (tile.forces_N.size() > 1 && inner - bar > 4 * space()) {
      ImGui::SameLine();
      const std::vector<float> values(tile.forces_N.begin(), tile.forces_N.end());
      sparkline(values, 0, static_cast<float>(std::max(tile.force_limit_N, tile.peak_force_N)), kSkyBlue,
                {inner - bar - 1.5F * space(), ImGui::GetFontSize() * 1.35F});
    }
  }
  if (!tile.verdict.empty()) {
    WithTextColour colour(tile.passed.value_or(true) ? kText : styleOf(Condition::kAttention).colour);
    textLine(tile.verdict, inner);
  }
  WithTextColour dim(tile.missed_ticks > 0 && tile.online ? kOrange : kDimText);
  ImGui::SetCursorPosY(height_px - ImGui::GetFontSize() - 1.1F * space());
  textLine(healthWords(tile), inner);
}

/// Result of a click on a tile.
enum class TileClick { kNone, kOpen, kSeen };

TileClick stationTile(const LabState& lab, const StationTile& tile, float width_px) {
  const float height_px = tileHeight_px();
  const ConditionStyle& style = styleOf(conditionOf(tile));
  const bool calls = needsHelp(tile.need);
  ImGui::PushID(tile.station.c_str());
  ImGui::PushStyleColor(ImGuiCol_Border, colourOf(calls ? style.colour : kLineGrey));
  ImGui::BeginChild(
      "tile", {width_px, height_px}, true,
      ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse | ImGuiWindowFlags_NoBackground);
  const ImVec2 corner = ImGui::GetWindowPos();
  solidRect(*ImGui::GetWindowDrawList(), {corner.x + 1, corner.y + 1},
            {corner.x + width_px - 1, corner.y + height_px - 1},
            calls ? mixed(kPanelGrey, style.colour, 0.16F) : kPanelGrey);
  const float inner = ImGui::GetContentRegionAvail().x;
  // Station, and its need at the right edge; a long name is cut so that the need stays visible.
  const std::string word = std::string(style.sign) + " " + std::string(nameOf(tile.need));
  const float word_px = ImGui::CalcTextSize(word.c_str()).x;
  textLine(tile.station, std::max(space(), inner - word_px - 2 * space()));
  ImGui::SameLine(inner + space() - word_px);
  {
    WithTextColour colour(style.colour);
    ImGui::TextUnformatted(word.c_str());
  }
  tileLines(lab, tile, inner, height_px);
  bool seen = false;
  if (tile.need == Need::kAlarm) {
    const WithFont small(Letters::kSmall);
    const float wide = ImGui::CalcTextSize("Seen").x + 2 * ImGui::GetStyle().FramePadding.x;
    ImGui::SetCursorPos({inner + space() - wide, height_px - ImGui::GetFrameHeight() - 0.6F * space()});
    seen = ImGui::Button("Seen");
  }
  const bool on_button = ImGui::IsAnyItemHovered();
  ImGui::EndChild();
  ImGui::PopStyleColor();
  const bool clicked = ImGui::IsItemClicked() && !on_button;
  if (ImGui::IsItemHovered()) ImGui::SetMouseCursor(ImGuiMouseCursor_Hand);
  ImGui::PopID();
  return seen ? TileClick::kSeen : clicked ? TileClick::kOpen : TileClick::kNone;
}

/// The number of stations per need.
void showCounts(const LabState& lab) {
  ImGui::AlignTextToFramePadding();
  const auto counts = lab.overview.counts();
  std::size_t help = 0;
  for (std::size_t i = 0; i < kNeedCount; ++i)
    if (needsHelp(static_cast<Need>(i))) help += counts[i];
  conditionLine(help > 0 ? Condition::kTrouble : Condition::kGood,
                help == 0 ? std::string("no one needs help")
                          : fmt::format("{} need{} help", help, help == 1 ? "s" : ""));
  for (const Need need : {Need::kPractising, Need::kWaiting, Need::kDone, Need::kOffline}) {
    ImGui::SameLine(0, 2 * space());
    WithTextColour dim(kDimText);
    ImGui::TextUnformatted(
        fmt::format("{} {}", counts[static_cast<std::size_t>(need)], nameOf(need)).c_str());
  }
}

void showChoices(LabState& lab) {
  ImGui::SameLine(0, 3 * space());
  ImGui::Checkbox("only those that need help", &lab.filter.only_help);
  ImGui::SameLine();
  ImGui::Checkbox("only online", &lab.filter.only_online);
  ImGui::SameLine();
  constexpr std::array<std::pair<TileOrder, const char*>, 4> kOrders = {
      {{TileOrder::kNeed, "by need"},
       {TileOrder::kName, "by name"},
       {TileOrder::kTrainee, "by trainee"},
       {TileOrder::kPeakForce, "by force"}}};
  ImGui::SetNextItemWidth(14 * space());
  const auto now =
      std::find_if(kOrders.begin(), kOrders.end(), [&](const auto& o) { return o.first == lab.order; });
  if (ImGui::BeginCombo("##order", now->second)) {
    for (const auto& [order, word] : kOrders)
      if (ImGui::Selectable(word, order == lab.order)) lab.order = order;
    ImGui::EndCombo();
  }
  ImGui::SameLine();
  ImGui::SetNextItemWidth(-1);
  ImGui::InputTextWithHint("##find", "find a name", &lab.filter.text);
}

}  // namespace

void showLab(LabState& lab) {
  showCounts(lab);
  showChoices(lab);
  const auto tiles = lab.overview.tiles(lab.order, lab.filter);
  if (lab.overview.size() == 0) {
    showEmpty("No stations yet",
              "An administrator adds stations: needlelab-admin station add NAME. Then a station is started "
              "with the "
              "key that this made, and appears here by itself.");
    return;
  }
  if (tiles.empty()) {
    if (showEmpty("No station matches", "The filter hides every station.", "Show all")) lab.filter = {};
    return;
  }
  ImGui::BeginChild("tiles", {0, 0}, false, ImGuiWindowFlags_NoBackground);
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  const float room = ImGui::GetContentRegionAvail().x;
  const int columns = std::max(1, static_cast<int>(room / (30 * space())));
  const float width = (room - gap * static_cast<float>(columns - 1)) / static_cast<float>(columns);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    if (i % static_cast<std::size_t>(columns) != 0) ImGui::SameLine();
    // skips tiles outside the visible area
    const ImVec2 at = ImGui::GetCursorScreenPos();
    if (!ImGui::IsRectVisible(at, {at.x + width, at.y + tileHeight_px()})) {
      ImGui::Dummy({width, tileHeight_px()});
      continue;
    }
    const std::string station = tiles[i]->station;
    const TileClick click = stationTile(lab, *tiles[i], width);
    if (click == TileClick::kOpen) lab.open(station);
    if (click == TileClick::kSeen) lab.overview.acknowledge(station);
  }
  ImGui::EndChild();
}

}  // namespace needlelab
