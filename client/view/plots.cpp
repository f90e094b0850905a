#include "client/view/plots.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "client/view/model/axis_ticks.h"
#include "client/view/plot_draw.h"
#include "client/view/theme.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

/// What a plot remembers from frame to frame: its range of y, so that it grows at once and shrinks calmly.
/// It holds for the stretch of x that was shown: a jump elsewhere or another zoom begins anew.
struct PlotMemory {
  double low = 0, high = 0;
  bool known = false;
  double from = 0, to = 0;  ///< x of the last frame

  void show(double new_from, double new_to) {
    const double span = to - from, new_span = new_to - new_from;
    if (new_from >= to || new_to <= from || new_span > 1.5 * span || span > 1.5 * new_span) known = false;
    from = new_from;
    to = new_to;
  }
};

PlotMemory& memoryOf(ImGuiID id) {
  // of the one context that a process has; ids are few and live as long as the window
  static std::map<ImGuiID, PlotMemory> memories;
  return memories[id];
}

struct PlotRange {
  double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
  void take(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  [[nodiscard]] bool known() const { return low <= high; }
};

AxisTicks rangeOf(const PlotSpec& spec, PlotRange data, PlotMemory& memory, float height_px) {
  const int wanted = std::clamp(static_cast<int>(height_px / (ImGui::GetFontSize() * 2.2F)), 2, 8);
  if (spec.low && spec.high) return axisTicks(*spec.low, *spec.high, wanted, false);
  if (!data.known()) data = {0, 1};
  // zero is part of the picture where it is near
  if (data.low > 0 && data.low < 0.6 * data.high) data.low = 0;
  if (data.high < 0 && data.high > 0.6 * data.low) data.high = 0;
  if (memory.known) {
    const double span = std::max(memory.high - memory.low, 1e-12);
    // the axis shrinks only when the data needs less than half of it
    if (data.low >= memory.low && data.high <= memory.high && data.high - data.low > 0.45 * span)
      return axisTicks(spec.low.value_or(memory.low), spec.high.value_or(memory.high), wanted, false);
  }
  // the data with a little air, in quarters of a step: the axis does not stir with each new greatest value
  const double air = 0.05 * (data.high - data.low);
  const double quarter = axisTicks(data.low, data.high, wanted, false).step / 4;
  const double low = data.low == 0 ? 0 : std::floor((data.low - air) / quarter) * quarter;
  const double high = data.high == 0 ? 0 : std::ceil((data.high + air) / quarter) * quarter;
  AxisTicks ticks = axisTicks(spec.low.value_or(low), spec.high.value_or(high), wanted, false);
  memory.low = ticks.low;
  memory.high = ticks.high;
  memory.known = true;
  return ticks;
}

std::string valueText(const PixelColumn& column, double step) {
  const int decimals = std::clamp(static_cast<int>(std::ceil(-std::log10(std::max(step, 1e-9)))) + 1, 0, 4);
  return tickText(static_cast<double>(column.last), decimals);
}

// the column nearest before, within a few
const PixelColumn* columnAt(std::span<const PixelColumn> columns, std::ptrdiff_t index) {
  for (std::ptrdiff_t i = index; i >= 0 && i > index - 6; --i)
    if (i < static_cast<std::ptrdiff_t>(columns.size()) && !columns[static_cast<std::size_t>(i)].empty())
      return &columns[static_cast<std::size_t>(i)];
  return nullptr;
}

void drawAxes(ImDrawList& list, const PlotFrame& frame, const PlotSpec& spec) {
  WithFont font(Letters::kSmall);
  const float text_px = ImGui::GetFontSize();
  const ImU32 line = packed(kLineGrey, 0.75F), words = packed(kDimText);
  for (const double value : frame.y.at) {
    const float y_px = frame.yAt(value);
    list.AddLine({frame.low_px.x, y_px}, {frame.high_px.x, y_px}, line);
    const std::string text = tickText(value, frame.y.decimals);
    drawPlotText(list, {frame.low_px.x - ImGui::CalcTextSize(text.c_str()).x - 6, y_px - text_px * 0.5F},
                 words, text);
  }
  const int wanted = std::max(2, static_cast<int>((frame.high_px.x - frame.low_px.x) / (text_px * 7)));
  const AxisTicks x = axisTicks(frame.from, frame.to, wanted, false, spec.clock_axis ? 0 : 1);
  for (const double value : x.at) {
    const float x_px = frame.xAt(value);
    list.AddLine({x_px, frame.low_px.y}, {x_px, frame.high_px.y}, line);
    if (!spec.show_x_axis) continue;
    std::string text = spec.clock_axis ? clockText(value, x.step < 1 ? 1 : 0) : tickText(value, x.decimals);
    if (!spec.clock_axis && value == x.at.back() && !spec.x_unit.empty()) text += " " + spec.x_unit;
    const float width_px = ImGui::CalcTextSize(text.c_str()).x;
    const float left_px =
        std::clamp(x_px - width_px * 0.5F, frame.low_px.x - 8, frame.high_px.x - width_px + 8);
    drawPlotText(list, {left_px, frame.high_px.y + 3}, words, text);
  }
  list.AddRect(frame.low_px, frame.high_px, packed(kLineGrey));
}

/// Title at the left, then the series with their colours; the values at the cursor or the mouse beside them.
void drawLegend(ImDrawList& list, ImVec2 at, float right_px, const PlotSpec& spec,
                std::span<const PlotSeries> series, std::span<const std::vector<PixelColumn>> columns,
                std::ptrdiff_t read_at, double step) {
  WithFont font(Letters::kSmall);
  const float text_px = ImGui::GetFontSize();
  std::string title = spec.title;
  if (!spec.unit.empty()) title += (title.empty() ? "" : ", ") + spec.unit;
  drawPlotText(list, at, packed(kText), title);
  float x_px = at.x + ImGui::CalcTextSize(title.c_str()).x + text_px;
  if (!spec.legend) return;
  for (std::size_t i = 0; i < series.size(); ++i) {
    std::string words = series[i].name;
    if (const PixelColumn* column = read_at >= 0 ? columnAt(columns[i], read_at) : nullptr)
      words += (words.empty() ? "" : " ") + valueText(*column, step);
    if (words.empty()) continue;
    const float width_px = ImGui::CalcTextSize(words.c_str()).x + text_px * 1.5F;
    if (x_px + width_px > right_px) return;
    const float y_px = at.y + text_px * 0.55F;
    const ImU32 colour = packed(series[i].colour);
    if (series[i].dashed) {
      list.AddLine({x_px, y_px}, {x_px + text_px * 0.35F, y_px}, colour, 3);
      list.AddLine({x_px + text_px * 0.6F, y_px}, {x_px + text_px * 0.95F, y_px}, colour, 3);
    } else {
      list.AddLine({x_px, y_px}, {x_px + text_px * 0.95F, y_px}, colour, 3);
    }
    drawPlotText(list, {x_px + text_px * 1.2F, at.y}, packed(kText), words);
    x_px += width_px + text_px * 0.7F;
  }
}

PlotResult mouseOn(const PlotFrame& frame) {
  PlotResult result;
  result.hovered = ImGui::IsItemHovered();
  const ImVec2 mouse = ImGui::GetIO().MousePos;
  const double per_px = (frame.to - frame.from) / static_cast<double>(frame.high_px.x - frame.low_px.x);
  const auto xOf = [&](float x_px) {
    return frame.from + static_cast<double>(x_px - frame.low_px.x) * per_px;
  };
  if (result.hovered) {
    result.hover_x = xOf(mouse.x);
    result.scrolled = static_cast<double>(ImGui::GetIO().MouseWheel);
  }
  if (ImGui::IsItemActive() && ImGui::IsMouseDown(0))
    result.clicked_x = std::clamp(xOf(mouse.x), frame.from, frame.to);
  if (result.hovered && ImGui::IsMouseDragging(1, 0))
    result.dragged = -static_cast<double>(ImGui::GetIO().MouseDelta.x) * per_px;
  return result;
}

}  // namespace

PlotResult linePlot(const char* id, const PlotSpec& spec, std::span<const PlotSeries> series,
                    ImVec2 size_px) {
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  if (size_px.x <= 0) size_px.x = rest.x;
  if (size_px.y <= 0) size_px.y = rest.y;
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const PlotField field = plotFieldAt(at, size_px, spec.show_x_axis);
  if (field.tooSmall()) {
    ImGui::Dummy(size_px);
    return {};
  }
  PlotFrame frame;
  frame.low_px = field.low_px;
  frame.high_px = field.high_px;
  ImGui::PushID(id);
  ImGui::SetCursorScreenPos(frame.low_px);
  ImGui::InvisibleButton("field", {frame.high_px.x - frame.low_px.x, frame.high_px.y - frame.low_px.y});
  frame.from = spec.from;
  frame.to = spec.to > spec.from ? spec.to : spec.from + 1;
  frame.downward = spec.downward;

  // one column a pixel
  const auto count = static_cast<std::size_t>(frame.high_px.x - frame.low_px.x);
  std::vector<std::vector<PixelColumn>> columns(series.size());
  PlotRange data;
  for (std::size_t i = 0; i < series.size(); ++i) {
    columns[i].resize(count);
    if (series[i].columns) series[i].columns(frame.from, frame.to, columns[i]);
    for (const PixelColumn& column : columns[i]) {
      if (column.empty()) continue;
      data.take(static_cast<double>(column.min));
      data.take(static_cast<double>(column.max));
    }
  }
  PlotMemory& memory = memoryOf(ImGui::GetID("memory"));
  memory.show(frame.from, frame.to);
  frame.y = rangeOf(spec, data, memory, frame.high_px.y - frame.low_px.y);
  const PlotResult result = mouseOn(frame);

  ImDrawList& list = *ImGui::GetWindowDrawList();
  solidRect(list, frame.low_px, frame.high_px, kWindowGrey);
  drawAxes(list, frame, spec);
  ImGui::PushClipRect(frame.low_px, frame.high_px, true);
  drawBands(list, frame, spec.bands);
  // the first is the chief one: it lies on top
  for (std::size_t i = series.size(); i-- > 0;) drawColumns(list, frame, series[i], columns[i]);
  const float mouse_px = ImGui::GetIO().MousePos.x;
  drawMarks(list, frame, spec.marks, result.hovered ? &mouse_px : nullptr);
  std::optional<double> read = spec.cursor;
  if (spec.cursor)
    list.AddLine({frame.xAt(*spec.cursor), frame.low_px.y}, {frame.xAt(*spec.cursor), frame.high_px.y},
                 packed(kWhite, 0.9F), 2);
  if (result.hovered) {
    read = result.hover_x;
    list.AddLine({mouse_px, frame.low_px.y}, {mouse_px, frame.high_px.y}, packed(kWhite, 0.45F));
  }
  ImGui::PopClipRect();
  const std::ptrdiff_t read_at =
      read ? static_cast<std::ptrdiff_t>((*read - frame.from) / (frame.to - frame.from) *
                                         static_cast<double>(count))
           : -1;
  drawLegend(list, {frame.low_px.x, at.y}, frame.high_px.x, spec, series, columns, read_at, frame.y.step);
  ImGui::PopID();
  ImGui::SetCursorScreenPos(at);
  ImGui::Dummy(size_px);
  return result;
}

PlotResult plotStack(const char* id, std::span<StackedPlot> plots, ImVec2 size_px) {
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  if (size_px.x <= 0) size_px.x = rest.x;
  if (size_px.y <= 0) size_px.y = rest.y;
  float shares = 0;
  for (const StackedPlot& plot : plots) shares += plot.share;
  if (plots.empty() || shares <= 0) return {};
  const float text_px = fontOf(Letters::kSmall)->FontSize;
  // the last one has the axis of x below it: its field is no smaller for that
  const float heights_px = size_px.y - text_px * 1.5F;
  PlotResult all;
  ImGui::PushID(id);
  ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, ImVec2{0, 0});
  for (std::size_t i = 0; i < plots.size(); ++i) {
    StackedPlot& plot = plots[i];
    const bool last = i + 1 == plots.size();
    plot.spec.show_x_axis = last;
    ImGui::PushID(static_cast<int>(i));
    const float height_px = heights_px * plot.share / shares + (last ? text_px * 1.5F : 0);
    const PlotResult one = linePlot("plot", plot.spec, plot.series, {size_px.x, height_px});
    ImGui::PopID();
    if (one.hovered) {
      all.hovered = true;
      all.hover_x = one.hover_x;
      all.scrolled = one.scrolled;
      all.dragged = one.dragged;
    }
    if (one.clicked_x) all.clicked_x = one.clicked_x;
  }
  ImGui::PopStyleVar();
  ImGui::PopID();
  return all;
}

void sparkline(std::span<const float> values, float low, float high, Rgb colour, ImVec2 size_px) {
  const ImVec2 at = ImGui::GetCursorScreenPos();
  ImDrawList& list = *ImGui::GetWindowDrawList();
  if (values.size() > 1 && high > low) {
    // no more points than pixels: of those that share one the greatest stands, so that a peak is never lost
    const auto most = static_cast<std::size_t>(std::max(2.0F, size_px.x));
    const std::size_t count = std::min(values.size(), most);
    std::vector<ImVec2> points(count);
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t first = i * values.size() / count,
                        end = std::max(first + 1, (i + 1) * values.size() / count);
      const float value = *std::max_element(values.begin() + static_cast<std::ptrdiff_t>(first),
                                            values.begin() + static_cast<std::ptrdiff_t>(end));
      const float share = std::clamp((value - low) / (high - low), 0.0F, 1.0F);
      points[i] = {at.x + size_px.x * static_cast<float>(i) / static_cast<float>(count - 1),
                   at.y + size_px.y - 2 - share * (size_px.y - 4)};
    }
    list.AddPolyline(points.data(), static_cast<int>(count), packed(colour), 0, 1.6F);
    list.AddCircleFilled(points.back(), 2.8F, packed(colour), 8);
  }
  ImGui::Dummy(size_px);
}

}  // namespace needlelab
