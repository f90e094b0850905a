#include "client/instructor/screens/station_tile.h"

#include <algorithm>
#include <vector>

#include "client/view/plots.h"
#include "client/view/theme.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

std::string depthWords(const StationTile& tile) {
  if (!tile.online || tile.session_id.empty()) return {};
  const std::string phase(phaseWord(tile.phase <= 3 ? static_cast<Phase>(tile.phase) : Phase::kFree));
  if (tile.layer < 0) return phase;
  const std::string where = tile.tissue.empty() ? formatted("layer %d", tile.layer + 1) : tile.tissue;
  return formatted("%s, %.1f mm, ", phase.c_str(), 1e3 * tile.insertion_m) + where;
}

/// What the loop and the line say, short.
std::string healthWords(const StationTile& tile) {
  if (!tile.online) return "offline";
  if (tile.stale) return "no news";
  std::string words = formatted("loop p99 %u µs", tile.wakeup_p99_us);
  if (tile.missed_ticks > 0)
    words += formatted(", %llu missed", static_cast<unsigned long long>(tile.missed_ticks));
  if (tile.spool_left > 0)
    words += formatted(", spool %llu", static_cast<unsigned long long>(tile.spool_left));
  return words;
}

}  // namespace

float tileHeight_px() {
  return 14.6F * space();
}

namespace {

/// The tile's lines, small letters; the child window is open.
void tileLines(const StationTile& tile, float inner, float height_px) {
  WithFont small(Letters::kSmall);
  {
    WithTextColour dim(tile.stale || !tile.online ? kDimText : kText);
    textLine(tile.trainee.empty() ? std::string("nobody") : tile.trainee + " · " + tile.exercise, inner);
    textLine(needsHelp(tile.need) ? tile.why : depthWords(tile), inner);
  }
  // force now against its limit, with the peak; the last seconds as a line
  if (tile.online && !tile.session_id.empty()) {
    const std::string words = formatted("%.1f N  peak %.1f", tile.force_N, tile.peak_force_N);
    // as wide as its words with the sign of too much force need
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
  WithTextColour dim(tile.missed_ticks > 0 && tile.online ? kOrange : kDimText);
  ImGui::SetCursorPosY(height_px - ImGui::GetFontSize() - 1.1F * space());
  textLine(healthWords(tile), inner);
}

}  // namespace

bool stationTile(const StationTile& tile, float width_px) {
  const float height_px = tileHeight_px();
  const ConditionStyle& style = styleOf(conditionOf(tile.need));
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
  // who, and at the right edge what is needed
  ImGui::TextUnformatted(tile.station.c_str());
  const std::string word = std::string(style.sign) + " " + std::string(wordOf(tile.need));
  ImGui::SameLine(std::max(ImGui::CalcTextSize(tile.station.c_str()).x + 2 * space(),
                           inner + space() - ImGui::CalcTextSize(word.c_str()).x));
  {
    WithTextColour colour(style.colour);
    ImGui::TextUnformatted(word.c_str());
  }
  tileLines(tile, inner, height_px);
  ImGui::EndChild();
  ImGui::PopStyleColor();
  const bool clicked = ImGui::IsItemClicked();
  if (ImGui::IsItemHovered()) ImGui::SetMouseCursor(ImGuiMouseCursor_Hand);
  ImGui::PopID();
  return clicked;
}

}  // namespace needlelab
