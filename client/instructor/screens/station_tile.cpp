#include "client/instructor/screens/station_tile.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "client/view/plots.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

constexpr float kAboveSkin = 0.15F;  // fraction of the column above the skin
constexpr double kOutside = 0.1;     // a tip outside stands so far above the skin, in columns

/// The tissues on the way in, the target, and the needle.
void depthColumn(const DepthPicture& picture, const StationTile& tile, ImVec2 corner, ImVec2 size) {
  ImDrawList& draw = *ImGui::GetWindowDrawList();
  const ImVec2 end{corner.x + size.x, corner.y + size.y};
  const auto y = [&](double depth_m) {
    const auto share = static_cast<float>(std::clamp(depth_m / picture.depth_m, -1.0, 1.0));
    return std::clamp(corner.y + size.y * (kAboveSkin + (1 - kAboveSkin) * share), corner.y, end.y);
  };
  draw.AddRectFilled(corner, end, packed(kBlack));
  for (const DepthPicture::Band& band : picture.bands) {
    draw.AddRectFilled({corner.x, y(band.top_m)}, {end.x, y(band.bottom_m)}, packed(band.colour, 0.8F));
    draw.AddLine({corner.x, y(band.top_m)}, {end.x, y(band.top_m)}, packed(kBlack, 0.6F));
  }
  for (const DepthPicture::Band& target : picture.targets)
    draw.AddRect({corner.x + 1, y(target.top_m)}, {end.x - 1, y(target.bottom_m)}, packed(target.colour), 0,
                 0, 2.5F);
  if (!tile.online || tile.session_id.empty()) return;
  const float middle = corner.x + 0.5F * size.x,
              tip = y(tile.layer < 0 ? -kOutside * picture.depth_m : tile.insertion_m);
  draw.AddLine({middle, corner.y}, {middle, tip}, packed(kBlack), 5);
  draw.AddLine({middle, corner.y}, {middle, tip}, packed(kWhite), 3);
  draw.AddTriangleFilled({middle - 4, tip - 2}, {middle + 4, tip - 2}, {middle, tip + 6}, packed(kWhite));
}

/// What the tile says besides its station, most important first, until it is full.
void tileLines(const LabState& lab, const StationTile& tile, const ConditionStyle& style, float bottom_px) {
  const float inner = ImGui::GetContentRegionAvail().x;
  const auto fits = [&](float lines) {
    return ImGui::GetCursorScreenPos().y + lines * ImGui::GetTextLineHeightWithSpacing() <= bottom_px + 1;
  };
  const bool away = tile.stale || !tile.online;
  const bool lesson = tile.online && !tile.session_id.empty();
  const WithTextColour dim(away ? kDimText : kText);
  if (!tile.trainee.empty()) {
    const bool wide = ImGui::CalcTextSize(tile.trainee.c_str()).x > inner;
    if (wide && fits(2))
      textBlock(tile.trainee);
    else
      textLine(tile.trainee, inner);
    if (fits(1)) textLine(lab.exerciseName(tile.exercise), inner);
  } else if (fits(1)) {
    textLine(lessonWords(tile, lab.exerciseName(tile.exercise)), inner);
  }
  if (needsHelp(tile.need) && fits(1)) {
    const WithTextColour colour(tile.calls ? style.colour : kDimText);
    const bool wide = ImGui::CalcTextSize(tile.why.c_str()).x > inner;
    if (wide && fits(2 + (lesson ? 1 : 0)))
      textBlock(tile.why);
    else
      textLine(tile.why, inner);
  }
  if (tile.online && tile.stale && fits(1)) textLine("no news", inner);
  if (lesson && !tile.stale && fits(1)) textLine(depthWords(tile), inner);
  if (!tile.verdict.empty() && fits(1)) {
    const WithTextColour colour(tile.passed.value_or(true) ? kText : styleOf(Condition::kAttention).colour);
    textLine(tile.verdict, inner);
  }
  if (!lesson || !fits(1.3F)) return;
  levelBar(tile.force_N / tile.force_limit_N, forceWords(tile), kSkyBlue, inner);
  const float left_px = bottom_px - ImGui::GetCursorScreenPos().y;
  if (tile.forces_N.size() < 2 || left_px < 2 * ImGui::GetTextLineHeight()) return;
  const std::vector<float> values(tile.forces_N.begin(), tile.forces_N.end());
  sparkline(values, 0, static_cast<float>(std::max(tile.force_limit_N, tile.peak_force_N)), kSkyBlue,
            {inner, left_px});
}

}  // namespace

ImVec2 leastTile_px() {
  const WithFont small(Letters::kSmall);
  return {20 * space(), 5 * ImGui::GetTextLineHeightWithSpacing() + 2 * space()};
}

TileClick stationTile(const LabState& lab, const StationTile& tile, ImVec2 size_px) {
  const ConditionStyle& style = styleOf(conditionOf(tile));
  const bool chosen = lab.chosen.contains(tile.station);
  const float pad = 0.7F * space();
  const WithFont letters(size_px.y > 24 * space() ? Letters::kBody : Letters::kSmall);
  ImGui::PushID(tile.station.c_str());
  ImGui::PushStyleColor(ImGuiCol_Border, colourOf(chosen ? kYellow : tile.calls ? style.colour : kLineGrey));
  ImGui::PushStyleVar(ImGuiStyleVar_ChildBorderSize, chosen || tile.calls ? 3.0F : 1.0F);
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {pad, pad});
  ImGui::BeginChild(
      "tile", size_px, true,
      ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoScrollWithMouse | ImGuiWindowFlags_NoBackground);
  const ImVec2 corner = ImGui::GetWindowPos();
  solidRect(*ImGui::GetWindowDrawList(), {corner.x + 1, corner.y + 1},
            {corner.x + size_px.x - 1, corner.y + size_px.y - 1},
            tile.calls ? mixed(kPanelGrey, style.colour, 0.2F) : kPanelGrey);
  const DepthPicture* const picture = lab.depthPicture(tile.exercise);
  float left = pad;
  if (picture != nullptr && tile.online && !tile.session_id.empty()) {
    const float wide = std::clamp(0.14F * size_px.x, 3 * space(), 12 * space());
    depthColumn(*picture, tile, {corner.x + pad, corner.y + pad}, {wide, size_px.y - 2 * pad});
    left += wide + pad;
  }
  ImGui::SetCursorPos({left, pad});
  ImGui::BeginGroup();
  bool mark = chosen;
  ImGui::PushStyleVar(ImGuiStyleVar_FramePadding, {0, 0});
  const bool marked = ImGui::Checkbox("##choose", &mark);
  ImGui::PopStyleVar();
  ImGui::SameLine();
  // the need at the right edge: without help its sign, where its word would cut the name
  std::string word = std::string(style.sign) + " " + std::string(nameOf(tile.need));
  const float room = size_px.x - pad - ImGui::CalcTextSize(word.c_str()).x - space() - ImGui::GetCursorPosX();
  if (!needsHelp(tile.need) && ImGui::CalcTextSize(tile.station.c_str()).x > room) word = style.sign;
  const float word_px = ImGui::CalcTextSize(word.c_str()).x, right = size_px.x - pad - word_px;
  {
    const WithTextColour dim(kDimText);
    textLine(tile.station, std::max(space(), right - space() - ImGui::GetCursorPosX()));
  }
  ImGui::SameLine(right - left);  // within the group
  {
    const WithTextColour colour(style.colour);
    ImGui::TextUnformatted(word.c_str());
  }
  tileLines(lab, tile, style, corner.y + size_px.y - pad);
  ImGui::EndGroup();
  const bool on_mark = marked || ImGui::IsAnyItemHovered();
  ImGui::EndChild();
  ImGui::PopStyleVar(2);
  ImGui::PopStyleColor();
  const bool clicked = ImGui::IsItemClicked() && !on_mark;
  if (ImGui::IsItemHovered()) ImGui::SetMouseCursor(ImGuiMouseCursor_Hand);
  ImGui::PopID();
  if (marked || (clicked && ImGui::GetIO().KeyCtrl)) return TileClick::kChoose;
  return clicked ? TileClick::kOpen : TileClick::kNone;
}

}  // namespace needlelab
