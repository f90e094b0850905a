#include "client/station/window/screens/lesson_screen.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "client/station/window/screens/station_actions.h"
#include "client/view/model/gesture_plots.h"
#include "client/view/model/palette.h"
#include "client/view/model/plot.h"
#include "client/view/model/scene_view.h"
#include "client/view/plots.h"
#include "client/view/scene/label_places.h"
#include "client/view/theme.h"
#include "common/base/text/text.h"
#include "common/base/units.h"
#include "common/haptics/phase_words.h"

namespace needlelab {

// --- the ladder of layers ---

namespace {

constexpr double kAboveSkin = 0.12;  // fraction of the ladder above the skin

struct LadderScale {
  ImVec2 corner, size;
  double depth_m;
  [[nodiscard]] float y(double depth) const {
    const double share = kAboveSkin + (1 - kAboveSkin) * depth / depth_m;
    return corner.y + size.y * static_cast<float>(std::clamp(share, 0.0, 1.0));
  }
};

void drawText(ImDrawList* draw, ImVec2 at, Rgb colour, const std::string& text) {
  draw->AddText(at, packed(colour), text.c_str());
}

}  // namespace

std::optional<double> ladderMark_m(const Moment& now) {
  if (isCapped(now)) return std::nullopt;
  return now.inside ? now.insertion_m : now.depth_m;
}

namespace {

// widths beside the scale, in space(): the bands, the tip's mark, the lines to the names
constexpr float kLadderBand = 3.2F, kLadderMark = 1.8F, kLadderGap = 0.6F;

/// The ladder's width with room for the longest word on the way to the target, and a scale of two digits.
float ladderNeed_px(const SceneView& scene) {
  const WithFont small(Letters::kSmall);
  float word_px = 0;
  const auto take = [&](const std::string& name) {
    std::istringstream words(name);
    for (std::string word; words >> word;) word_px = std::max(word_px, ImGui::CalcTextSize(word.c_str()).x);
  };
  for (const TissuesOnLine::Tissue& tissue :
       tissuesOnLine(scene, lineToTarget(scene), ladderDepth_m(scene)).tissues)
    take(scene.layers[static_cast<std::size_t>(tissue.layer)].name);
  for (const TargetView& target : scene.targets) take(target.name);
  return word_px + ImGui::CalcTextSize("00").x + (1 + kLadderBand + kLadderMark + kLadderGap) * space() + 2;
}

/// A name beside the ladder, and what it names.
struct LadderName {
  std::string text;
  Rgb mark, letters;
  float from_px, to_px;  ///< of what it names
  bool kept;
};

/// The names from `left_px` to `right_px`, wrapped, each with a line to its band, which ends at `band_px`.
void drawLadderNames(ImDrawList* draw, std::vector<LadderName> names, float band_px, float left_px,
                     float right_px, float top_px, float bottom_px) {
  const auto middle = [](const LadderName& name) { return 0.5F * (name.from_px + name.to_px); };
  std::stable_sort(names.begin(), names.end(),
                   [&](const LadderName& a, const LadderName& b) { return middle(a) < middle(b); });
  const float wrap_px = right_px - left_px, line_px = ImGui::GetTextLineHeight();
  std::vector<SideLabel> labels;
  for (const LadderName& name : names)
    labels.push_back({middle(name), ImGui::CalcTextSize(name.text.c_str(), nullptr, false, wrap_px).y,
                      name.to_px - name.from_px, name.kept});
  const std::vector<float> tops_px = placeLabels(labels, top_px, bottom_px);
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (tops_px[i] < 0) continue;
    draw->AddLine({band_px, middle(names[i])}, {left_px - 0.4F * space(), tops_px[i] + 0.5F * line_px},
                  packed(names[i].mark, 0.9F), 1.5F);
    draw->AddText(ImGui::GetFont(), ImGui::GetFontSize(), {left_px, tops_px[i]}, packed(names[i].letters),
                  names[i].text.c_str(), nullptr, wrap_px);
  }
}

}  // namespace

void layerLadder(const SceneView& scene, const Moment& now, const AidSet& aids, ImVec2 size_px) {
  const bool names = aids.has(pb::Exercise::LAYER), depth = aids.has(pb::Exercise::DEPTH),
             anatomy = aids.has(pb::Exercise::ANATOMY);
  if (!names && !depth) return;
  const WithFont small(Letters::kSmall);
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  if (size_px.x <= 0) size_px.x = ImGui::GetContentRegionAvail().x;
  ImGui::Dummy(size_px);
  ImDrawList* const draw = ImGui::GetWindowDrawList();
  const double depth_m = ladderDepth_m(scene, now.insertion_m);
  const AxisTicks ticks = axisTicks(0, 1e3 * depth_m, 5, false);
  float scale_width = 0;
  if (depth)
    for (const double mm : ticks.at)
      scale_width =
          std::max(scale_width, ImGui::CalcTextSize(tickText(mm, ticks.decimals).c_str()).x + space());
  const float mark_width = kLadderMark * space();
  const bool beside = names || anatomy;  // names stand beside the bands
  const float band_width = beside ? kLadderBand * space() : size_px.x - scale_width - mark_width;
  const LadderScale ladder{{corner.x + scale_width, corner.y}, {band_width, size_px.y}, depth_m};
  const TissuesOnLine way = tissuesOnLine(scene, lineOf(now).value_or(lineToTarget(scene)), ladder.depth_m);
  const float left = ladder.corner.x, right = left + ladder.size.x, bottom = corner.y + size_px.y;
  const float line = ImGui::GetTextLineHeight();
  std::vector<LadderName> all;

  draw->PushClipRect(corner, {corner.x + size_px.x, bottom}, true);
  draw->AddRectFilled({left, corner.y}, {right, ladder.y(0)}, packed(kPanelGrey));
  const std::optional<double> at_m = ladderMark_m(now);
  for (const TissuesOnLine::Tissue& tissue : way.tissues) {
    const LayerView& layer = scene.layers[static_cast<std::size_t>(tissue.layer)];
    const float top = ladder.y(tissue.top_m), end = ladder.y(tissue.bottom_m);
    const Rgb colour = names ? layer.colour : kLineGrey;
    const bool here = names && at_m && tissue.holds(now.layer, *at_m);
    draw->AddRectFilled({left, top}, {right, end}, packed(colour, here || !names ? 1.0F : 0.65F));
    draw->AddLine({left, top}, {right, top}, packed(kBlack, 0.6F));
    if (here) draw->AddRect({left, top}, {right, end}, packed(kWhite), 0, 0, 2.5F);
    if (names && !(anatomy && isTarget(scene, tissue.layer)))
      all.push_back({layer.name, layer.colour, here ? kWhite : kDimText, top, end, here});
  }
  if (anatomy)
    for (const TissuesOnLine::Aim& aim : way.targets) {
      const float y = ladder.y(0.5 * (aim.top_m + aim.bottom_m)),
                  reach = std::max(3.0F, ladder.y(aim.bottom_m) - y);
      const float edge = right - 0.9F * space();
      draw->AddRectFilled({edge, y - reach}, {right, y + reach}, packed(kTargetColour));
      draw->AddRect({edge, y - reach}, {right, y + reach}, packed(kWhite));
      if (!aim.name.empty())
        all.push_back({aim.name, kTargetColour, kTargetColour, y - reach, y + reach, true});
    }
  if (depth)
    for (const double mm : ticks.at) {
      const float y = ladder.y(1e-3 * mm);
      draw->AddLine({left - 0.5F * space(), y}, {left, y}, packed(kDimText));
      drawText(draw, {corner.x, std::min(y - 0.5F * line, bottom - line)}, kDimText,
               tickText(mm, ticks.decimals));
    }
  if (depth && at_m) {
    // the tip, even outside the tissue
    const float y = ladder.y(std::max(*at_m, -kAboveSkin / (1 - kAboveSkin) * ladder.depth_m));
    draw->AddLine({left, y}, {right, y}, packed(kWhite), 2);
    draw->AddTriangleFilled({right + 0.2F * space(), y}, {right + 1.6F * space(), y - 0.8F * space()},
                            {right + 1.6F * space(), y + 0.8F * space()}, packed(kWhite));
    // the opening, where an injection goes
    const double opening_m = *at_m - openingBehindTip_m(scene.needle);
    if (opening_m > 0 && opening_m < *at_m)
      draw->AddCircle({right - 0.9F * space(), ladder.y(opening_m)}, 0.45F * space(), packed(kWhite), 0, 2);
  }
  draw->AddRect({left, corner.y}, {right, bottom}, packed(kLineGrey));
  drawLadderNames(draw, std::move(all), right, right + mark_width + kLadderGap * space(),
                  corner.x + size_px.x, corner.y, bottom);
  draw->PopClipRect();
}

// --- the panel ---

std::vector<float> cellColumns(std::span<const float> needed_px, float gap_px, float room_px) {
  for (std::size_t columns = needed_px.size(); columns > 1; columns = (columns + 1) / 2) {
    std::vector<float> widths_px(columns, 0.0F);
    for (std::size_t i = 0; i < needed_px.size(); ++i)
      widths_px[i % columns] = std::max(widths_px[i % columns], needed_px[i]);
    const float rest_px = room_px - std::accumulate(widths_px.begin(), widths_px.end(), 0.0F) -
                          gap_px * static_cast<float>(columns - 1);
    if (rest_px < 0) continue;
    for (float& width_px : widths_px) width_px += rest_px / static_cast<float>(columns);
    return widths_px;
  }
  return {room_px};
}

namespace {

constexpr double kPlotSpan_s = 20;

std::string mm(double metres, int decimals = 1) {
  return fixedText(1e3 * metres, decimals);
}

void showFigures(const LessonFollow& lesson, const AidSet& aids, float width) {
  const Moment& now = lesson.now();
  std::vector<std::pair<int, std::string>> shown;  // which, value
  if (aids.has(pb::Exercise::FORCE)) shown.emplace_back(0, tickText(forceOf(now), *momentDecimals("N")));
  if (aids.has(pb::Exercise::DEPTH)) shown.emplace_back(1, now.inside ? mm(now.insertion_m) : "–");
  if (shown.empty()) return;
  const float each = width / static_cast<float>(shown.size());
  const float left = ImGui::GetCursorPosX();
  for (std::size_t i = 0; i < shown.size(); ++i) {
    if (i > 0) ImGui::SameLine(left + each * static_cast<float>(i));
    ImGui::BeginGroup();
    if (shown[i].first == 0)
      figure(shown[i].second, "N", "force on the hand");
    else
      figure(shown[i].second, "mm", "inserted");
    ImGui::EndGroup();
  }
}

// one line each; the lines keep their place while the needle is outside, so that nothing below them moves
void showState(const LessonFollow& lesson, const AidSet& aids) {
  const Moment& now = lesson.now();
  const SceneView& scene = *lesson.scene();
  const bool phase = aids.has(pb::Exercise::PHASE), layer = aids.has(pb::Exercise::LAYER);
  const int opening = now.inside ? layerAt(scene, openingOf(scene, now.p_WT_m, now.q_WT)) : now.layer;
  const auto showOpening = [&] {
    // a tick that was not stepped has an earlier tick's layer
    if (!layer || opening == now.layer || (now.flags & kFlagNotStepped) != 0) return;
    ImGui::SameLine();
    textLine(opening < 0 ? "opening outside" : "opening in " + layerName(scene, opening));
  };
  if (phase) {
    {
      const WithFont heading(Letters::kHeading);
      const WithTextColour colour(phaseColour(now.phase));
      textLine(isCapped(now) ? "capped" : phaseWord(now.phase));
    }
    showOpening();
  }
  if (!layer) return;
  {
    const WithFont heading(Letters::kHeading);
    textLine(now.inside ? "in " + layerName(scene, now.layer) : "–");
  }
  if (!phase) showOpening();
}

void showAlignment(const LessonFollow& lesson) {
  const Moment& now = lesson.now();
  struct Cell {
    std::string caption, value;
    const char* widest;  ///< a usual value, so that the columns do not move
  };
  const auto degrees = [](double rad) { return fmt::format("{:.0f}°", degreesOf(rad)); };
  const std::vector<Cell> cells = {
      {"from own line", now.inside ? mm(now.lateral_error_m) + " mm" : "–", "10.0 mm"},
      {"tilt", now.inside ? degrees(now.tilt_rad) : "–", "90°"},
      {"speed", now.inside ? fmt::format("{:.0f} mm/s", 1e3 * std::abs(now.speed_mps)) : "–", "100 mm/s"}};
  std::vector<float> needed_px;
  for (const Cell& cell : cells) {
    const float value_px =
        std::max(ImGui::CalcTextSize(cell.value.c_str()).x, ImGui::CalcTextSize(cell.widest).x);
    const WithFont small(Letters::kSmall);
    needed_px.push_back(std::max(value_px, ImGui::CalcTextSize(cell.caption.c_str()).x));
  }
  const float gap_px = ImGui::GetStyle().ItemSpacing.x;
  const std::vector<float> columns_px = cellColumns(needed_px, gap_px, ImGui::GetContentRegionAvail().x);
  const float left_px = ImGui::GetCursorPosX();
  float x_px = left_px;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const std::size_t column = i % columns_px.size();
    if (column == 0) x_px = left_px;
    if (column > 0) ImGui::SameLine(x_px);
    ImGui::BeginGroup();
    {
      const WithFont small(Letters::kSmall);
      const WithTextColour dim(kDimText);
      ImGui::TextUnformatted(cells[i].caption.c_str());
    }
    ImGui::TextUnformatted(cells[i].value.c_str());
    ImGui::EndGroup();
    x_px += columns_px[column] + gap_px;
  }
}

void showPlunger(const LessonFollow& lesson) {
  const double plunger = lesson.now().plunger;
  levelBar(plunger, fmt::format("plunger {:.0f} %", 100 * plunger), kSkyBlue,
           ImGui::GetContentRegionAvail().x);
}

// plots the last seconds of the forces, with the exercise's limits
void showForces(const LessonFollow& lesson, ImVec2 size_px) {
  const double now_s = std::max(lesson.trace().lastTime_s(), kPlotSpan_s);
  std::vector<Plot> plots;
  plots.push_back(
      gesturePlot(GesturePlot::kForces, lesson.trace(), lesson.scene().get(), now_s - kPlotSpan_s, now_s));
  if (const auto& exercise = lesson.beginning().lesson.exercise)
    addLimits(plots.back(), GesturePlot::kForces, requirementsOf(*exercise));
  plotStack("forces", plots, size_px);
}

}  // namespace

bool lessonPanel(const BoardState& state, const LessonFollow& lesson, const AidSet& aids,
                 UltrasoundView& ultrasound, ImVec2 size_px) {
  beginPanel("figures", "", size_px.x, size_px.y);
  const float width = ImGui::GetContentRegionAvail().x, gap = ImGui::GetStyle().ItemSpacing.y;
  showState(lesson, aids);
  showFigures(lesson, aids, width);
  if (aids.has(pb::Exercise::ALIGNMENT)) showAlignment(lesson);
  showPlunger(lesson);

  // ladder, slice and plot share the remaining height; the light is the last line
  const float light = ImGui::GetTextLineHeight() + 2 + gap;
  const float rest = std::max(8 * space(), ImGui::GetContentRegionAvail().y - light);
  const bool ladder = aids.has(pb::Exercise::LAYER) || aids.has(pb::Exercise::DEPTH);
  const bool slice = aids.has(pb::Exercise::ULTRASOUND);
  const bool forces = aids.has(pb::Exercise::FORCE);
  // if letters are large for the window, the plot moves beside the ladder, or gives way to the slice
  const bool below = forces && rest > 26 * space();
  const bool beside = forces && !below && !slice;
  const float upper = !ladder && !slice ? (beside ? rest : 0) : below ? 0.52F * rest : rest;
  const float ladder_width = (slice || beside) && ladder
                                 ? std::clamp(ladderNeed_px(*lesson.scene()), 0.42F * width, 0.62F * width)
                                 : width;
  if (ladder) {
    layerLadder(*lesson.scene(), lesson.now(), aids, {ladder_width, upper - gap});
    if (slice || beside) ImGui::SameLine();
  }
  if (slice)
    ultrasound.show("ultrasound", *lesson.scene(), lesson.now(), {0, upper - gap},
                    aids.has(pb::Exercise::ANATOMY));
  if (beside) showForces(lesson, {0, upper - gap});
  if (below) showForces(lesson, {width, rest - upper});
  if (!ladder && !slice && !forces && !aids.has(pb::Exercise::PHASE) && !aids.has(pb::Exercise::ALIGNMENT)) {
    const WithTextColour dim(kDimText);
    textBlock(lesson.beginning().lesson.exam ? "This exam is done by feel."
                                             : "This exercise is done by feel.");
  }
  const auto facts = lessonFacts(state, lesson.beginning(), lesson.dropped(), lesson.now().alpha_rad);
  const bool clicked = stationLight(lightOf(facts));
  endPanel();
  return clicked;
}

}  // namespace needlelab
