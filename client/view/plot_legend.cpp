#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "client/view/plots.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

void drawLegendText(ImDrawList& list, ImVec2 at, ImU32 colour, std::string_view text) {
  list.AddText(at, colour, text.data(), text.data() + text.size());
}

std::string readText(double value, const Plot& plot, double step) {
  const int by_axis = std::clamp(static_cast<int>(std::ceil(-std::log10(std::max(step, 1e-9)))) + 1, 0, 4);
  return tickText(value, momentDecimals(plot.unit).value_or(by_axis));
}

// The nearest earlier non-empty column, within a few.
const PixelColumn* columnAt(std::span<const PixelColumn> columns, std::ptrdiff_t index) {
  for (std::ptrdiff_t i = index; i >= 0 && i > index - 6; --i)
    if (i < static_cast<std::ptrdiff_t>(columns.size()) && !columns[static_cast<std::size_t>(i)].empty())
      return &columns[static_cast<std::size_t>(i)];
  return nullptr;
}

/// The value of a series at x.
std::optional<double> valueAt(const Plot& plot, const PlotSeries& series,
                              std::span<const PixelColumn> columns, double x) {
  if (series.reader) return series.reader(x);
  const double to = plot.to > plot.from ? plot.to : plot.from + 1;
  const PixelColumn* const column = columnAt(
      columns,
      static_cast<std::ptrdiff_t>((x - plot.from) / (to - plot.from) * static_cast<double>(columns.size())));
  return column == nullptr ? std::nullopt : std::optional(static_cast<double>(column->last));
}

/// A legend entry, and its width with the swatch before it.
struct LegendEntry {
  const PlotSeries* series;
  std::string text;
  float width_px;
};

/// `with_values`: how many of the first series show their value at `read_x`.
std::vector<LegendEntry> legendOf(const Plot& plot, std::span<const std::vector<PixelColumn>> columns,
                                  std::optional<double> read_x, double step, std::size_t with_values) {
  std::vector<LegendEntry> entries;
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    std::string text = plot.series[i].name;
    const auto value =
        read_x && i < with_values ? valueAt(plot, plot.series[i], columns[i], *read_x) : std::nullopt;
    if (value) text += (text.empty() ? "" : " ") + readText(*value, plot, step);
    if (text.empty()) continue;
    const float width_px = ImGui::CalcTextSize(text.c_str()).x + ImGui::GetFontSize() * 1.2F;
    entries.push_back({&plot.series[i], std::move(text), width_px});
  }
  return entries;
}

}  // namespace

void drawPlotLegend(ImDrawList& list, ImVec2 at, float right_px, const Plot& plot,
                    std::span<const std::vector<PixelColumn>> columns, std::optional<double> read_x,
                    double step) {
  WithFont font(Letters::kSmall);
  const float text_px = ImGui::GetFontSize();
  const std::string title = headingOf(plot);
  drawLegendText(list, at, packed(kText), title);
  float x_px = at.x + ImGui::CalcTextSize(title.c_str()).x + text_px;
  if (!plot.legend) return;
  const auto widthOf = [&](const std::vector<LegendEntry>& entries) {
    float width_px = 0;
    for (const LegendEntry& entry : entries) width_px += entry.width_px + text_px;
    return width_px - text_px;
  };
  auto entries = legendOf(plot, columns, read_x, step, plot.series.size());
  if (x_px + widthOf(entries) > right_px) entries = legendOf(plot, columns, read_x, step, 1);
  const bool fits = x_px + widthOf(entries) <= right_px;
  const float end_px = fits ? right_px : right_px - text_px * 2;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (!fits && x_px + entries[i].width_px > end_px) {
      drawLegendText(list, {x_px, at.y}, packed(kDimText), "+" + std::to_string(entries.size() - i));
      return;
    }
    const float y_px = at.y + text_px * 0.55F;
    const ImU32 colour = packed(entries[i].series->colour);
    if (entries[i].series->dashed) {
      list.AddLine({x_px, y_px}, {x_px + text_px * 0.35F, y_px}, colour, 3);
      list.AddLine({x_px + text_px * 0.6F, y_px}, {x_px + text_px * 0.95F, y_px}, colour, 3);
    } else {
      list.AddLine({x_px, y_px}, {x_px + text_px * 0.95F, y_px}, colour, 3);
    }
    drawLegendText(list, {x_px + text_px * 1.2F, at.y}, packed(kText), entries[i].text);
    x_px += entries[i].width_px + text_px;
  }
}

}  // namespace needlelab
