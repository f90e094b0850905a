#include "client/view/plots.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "client/view/theme.h"

namespace needlelab {
namespace {

/// Maps a plot's values to the surface.
struct PlotFrame {
  ImVec2 low_px, high_px;  ///< corners of the field: upper left, lower right
  double from = 0, to = 1;
  AxisTicks y;
  bool downward = false;

  [[nodiscard]] float xAt(double x) const {
    return low_px.x + static_cast<float>((x - from) / (to - from)) * (high_px.x - low_px.x);
  }
  [[nodiscard]] float yAt(double value) const {
    const auto share = static_cast<float>((value - y.low) / (y.high - y.low));
    return downward ? low_px.y + share * (high_px.y - low_px.y) : high_px.y - share * (high_px.y - low_px.y);
  }
};

constexpr float kLevel_px = 0.2F;  // smaller differences are invisible

ImVec2 sizeOfText(std::string_view text) {
  return ImGui::CalcTextSize(text.data(), text.data() + text.size());
}

void strokeRun(ImDrawList& list, const std::vector<ImVec2>& run, ImU32 colour, float width_px, bool dashed) {
  if (run.size() == 1) {
    list.AddCircleFilled(run.front(), width_px, colour, 6);
    return;
  }
  if (!dashed) {
    list.AddPolyline(run.data(), static_cast<int>(run.size()), colour, 0, width_px);
    return;
  }
  // Dashes of equal length along the line.
  constexpr float kOn_px = 6, kPeriod_px = 10;
  float along_px = 0;
  for (std::size_t i = 1; i < run.size(); ++i) {
    const ImVec2 a = run[i - 1], b = run[i];
    const float length_px = std::hypot(b.x - a.x, b.y - a.y);
    for (float at_px = 0; at_px < length_px;) {
      const float phase_px = std::fmod(along_px + at_px, kPeriod_px);
      const bool on = phase_px < kOn_px;
      const float step_px =
          std::min(length_px - at_px, std::max(0.01F, (on ? kOn_px : kPeriod_px) - phase_px));
      const auto at = [&](float s) {
        return ImVec2{a.x + (b.x - a.x) * s / length_px, a.y + (b.y - a.y) * s / length_px};
      };
      if (on) list.AddLine(at(at_px), at(at_px + step_px), colour, width_px);
      at_px += step_px;
    }
    along_px += length_px;
  }
}

void drawPlotText(ImDrawList& list, ImVec2 at, ImU32 colour, std::string_view text) {
  list.AddText(at, colour, text.data(), text.data() + text.size());
}

void drawColumns(ImDrawList& list, const PlotFrame& frame, const Plot& plot, const PlotSeries& series,
                 std::span<const PixelColumn> columns) {
  const ImU32 colour = packed(series.colour);
  // with whole pixels, ImGui draws a line with half of the triangles
  const float width_px = std::max(1.0F, std::round(space() * 0.21F));
  const float per_column_px =
      (frame.high_px.x - frame.low_px.x) / static_cast<float>(std::max<std::size_t>(columns.size(), 1));
  const float tall_px = 2 * width_px;
  std::vector<ImVec2> run;
  int empty_run = 0;
  std::optional<std::size_t> before;
  const auto flush = [&] {
    if (series.filled && run.size() > 1) {
      const float zero_px = std::clamp(frame.yAt(0), frame.low_px.y, frame.high_px.y);
      const ImU32 faint = packed(series.colour, 0.16F);
      for (std::size_t i = 1; i < run.size(); ++i)
        list.AddRectFilled({run[i - 1].x, std::min(run[i].y, zero_px)},
                           {run[i].x, std::max(run[i].y, zero_px)}, faint);
    }
    if (!run.empty()) strokeRun(list, run, colour, width_px, series.dashed);
    run.clear();
  };
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const PixelColumn& column = columns[i];
    if (column.empty()) {
      // one or two empty columns mean a slow stream; more are a gap or missing values
      if (++empty_run > 3 + static_cast<int>(columns.size()) / 60) flush();
      continue;
    }
    empty_run = 0;
    if (before && isBroken(plot, *before, i, columns.size())) flush();
    before = i;
    const float x_px = frame.low_px.x + (static_cast<float>(i) + 0.5F) * per_column_px;
    const float top_px = frame.yAt(static_cast<double>(column.max)),
                low_px = frame.yAt(static_cast<double>(column.min));
    if (std::fabs(top_px - low_px) > tall_px)
      list.AddRectFilled({x_px - 0.5F * per_column_px, std::min(top_px, low_px)},
                         {x_px + 0.5F * per_column_px, std::max(top_px, low_px)},
                         packed(series.colour, 0.65F));
    const float y_px = frame.yAt(static_cast<double>(column.last));
    // a level stretch only needs its ends
    if (run.size() > 1 && std::fabs(run[run.size() - 1].y - y_px) < kLevel_px &&
        std::fabs(run[run.size() - 2].y - y_px) < kLevel_px)
      run.back().x = x_px;
    else
      run.push_back({x_px, y_px});
  }
  flush();
}

void drawBands(ImDrawList& list, const PlotFrame& frame, std::span<const PlotBand> bands) {
  WithFont font(Letters::kSmall);
  const float text_px = ImGui::GetFontSize();
  float taken_to_px = -1, taken_right_px = -1;
  for (const PlotBand& band : bands) {
    const float a_px = frame.yAt(std::clamp(band.low, frame.y.low, frame.y.high));
    const float b_px = frame.yAt(std::clamp(band.high, frame.y.low, frame.y.high));
    const float top_px = std::min(a_px, b_px), low_px = std::max(a_px, b_px + (band.is_target ? 2.0F : 0));
    const float left_px = std::max(frame.low_px.x, frame.xAt(band.from)),
                right_px = std::min(frame.high_px.x, frame.xAt(band.to)),
                name_end_px = std::min(frame.high_px.x, frame.xAt(band.name_to));
    if (low_px - top_px < 0.5F) continue;
    list.AddRectFilled({left_px, top_px}, {right_px, low_px},
                       packed(band.colour, band.is_target ? 0.35F : 0.17F));
    list.AddLine({left_px, top_px}, {right_px, top_px}, packed(band.colour, 0.45F));
    if (band.name.empty() || name_end_px - left_px < 4 * text_px) continue;
    const std::string name = fittedText(band.name, name_end_px - left_px - 12);
    if (band.is_target) {
      const float width_px = sizeOfText(name).x;
      drawPlotText(list, {name_end_px - width_px - 4, (top_px + low_px - text_px) * 0.5F},
                   packed(mixed(band.colour, kWhite, 0.75F)), name);
      continue;
    }
    // a stripe in full colour at the edge connects the name with the tissue's colour elsewhere
    list.AddRectFilled({left_px, top_px}, {left_px + 4, low_px}, packed(band.colour, 0.9F));
    if (left_px >= taken_right_px) taken_to_px = -1;  // of another insertion
    const float at_px = std::max((top_px + low_px - text_px) * 0.5F, taken_to_px);
    if (at_px + text_px > low_px + text_px * 0.35F) continue;
    drawPlotText(list, {left_px + 9, at_px}, packed(mixed(band.colour, kWhite, 0.45F), 0.95F), name);
    taken_to_px = at_px + text_px * 0.92F;
    taken_right_px = name_end_px;
  }
}

/// Each limit as a dashed line, with its text at the right end: below the line, or above it near the lower
/// edge.
void drawLimits(ImDrawList& list, const PlotFrame& frame, std::span<const PlotLimit> limits) {
  WithFont font(Letters::kSmall);
  const Rgb colour = styleOf(Condition::kAttention).colour;
  for (const PlotLimit& limit : limits) {
    const float y_px = frame.yAt(limit.at);
    strokeRun(list, {{frame.low_px.x, y_px}, {frame.high_px.x, y_px}}, packed(colour, 0.85F), 1.5F, true);
    const ImVec2 size = sizeOfText(limit.text);
    const bool below = y_px + size.y + 2 < frame.high_px.y;
    drawPlotText(list, {frame.high_px.x - size.x - 4, below ? y_px + 1 : y_px - size.y - 1},
                 packed(mixed(colour, kWhite, 0.3F)), limit.text);
  }
}

void drawMarks(ImDrawList& list, const PlotFrame& frame, std::span<const PlotMark> marks,
               const float* hover_x_px) {
  WithFont font(Letters::kSmall);
  const PlotMark* nearest = nullptr;
  float nearest_px = 7, sign_free_px = -1e9F;
  for (const PlotMark& mark : marks) {
    if (mark.x < frame.from || mark.x > frame.to) continue;
    const float x_px = frame.xAt(mark.x);
    list.AddLine({x_px, frame.low_px.y}, {x_px, frame.high_px.y}, packed(mark.colour, 0.38F));
    const float width_px = sizeOfText(mark.sign).x;
    // omit signs that would overlap, but keep their lines
    if (!mark.sign.empty() && x_px - width_px * 0.5F > sign_free_px) {
      drawPlotText(list, {x_px - width_px * 0.5F, frame.low_px.y + 1}, packed(mark.colour), mark.sign);
      sign_free_px = x_px + width_px * 0.5F;
    }
    if (hover_x_px != nullptr && !mark.text.empty() && std::fabs(*hover_x_px - x_px) < nearest_px) {
      nearest = &mark;
      nearest_px = std::fabs(*hover_x_px - x_px);
    }
  }
  if (nearest == nullptr) return;
  const ImVec2 size = sizeOfText(nearest->text);
  const float x_px = std::clamp(frame.xAt(nearest->x) - size.x * 0.5F, frame.low_px.x,
                                std::max(frame.low_px.x, frame.high_px.x - size.x));
  const ImVec2 at{x_px, frame.low_px.y + ImGui::GetFontSize() * 1.15F};
  list.AddRectFilled({at.x - 4, at.y - 2}, {at.x + size.x + 4, at.y + size.y + 2}, packed(kBlack, 0.8F), 4);
  drawPlotText(list, at, packed(mixed(nearest->colour, kWhite, 0.4F)), nearest->text);
}

/// A plot's y range between frames: it grows at once and shrinks slowly. Valid for the current x range; a
/// jump or zoom resets it.
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
  // One map suffices: a process has one ImGui context, with few ids that live as long as the window.
  static std::map<ImGuiID, PlotMemory> memories;
  return memories[id];
}

/// A few points joined by lines; each point is a small peg on its line.
void fillThrough(std::span<const double> x, std::span<const double> y, double from, double to,
                 std::span<PixelColumn> out) {
  const double width = (to - from) / static_cast<double>(out.size());
  const auto [low, high] = std::minmax_element(y.begin(), y.end());
  const double peg = 0.03 * (*high - *low);
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i] = {};
    const double at = from + (static_cast<double>(i) + 0.5) * width;
    if (at < x.front() - 0.5 * width || at > x.back() + 0.5 * width) continue;
    const auto right = std::min<std::size_t>(
        static_cast<std::size_t>(std::upper_bound(x.begin(), x.end(), at) - x.begin()), x.size() - 1);
    const std::size_t left = right == 0 ? 0 : right - 1;
    const double step = x[right] - x[left];
    const double share = step > 0 ? std::clamp((at - x[left]) / step, 0.0, 1.0) : 0.0;
    const double value = y[left] + share * (y[right] - y[left]);
    const bool point = std::abs(at - x[left]) <= 1.5 * width || std::abs(at - x[right]) <= 1.5 * width;
    out[i].last = static_cast<float>(value);
    out[i].min = static_cast<float>(value - (point ? peg : 0));
    out[i].max = static_cast<float>(value + (point ? peg : 0));
  }
}

void fillSeries(const PlotSeries& series, double from, double to, std::span<PixelColumn> out) {
  if (series.columns)
    series.columns(from, to, out);
  else if (!series.x.empty() && series.x.size() == series.y.size())
    fillThrough(series.x, series.y, from, to, out);
}

struct PlotRange {
  double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
  void take(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  [[nodiscard]] bool known() const { return low <= high; }
};

AxisTicks rangeOf(const Plot& plot, PlotRange data, PlotMemory& memory, float height_px) {
  const int wanted = std::clamp(static_cast<int>(height_px / (ImGui::GetFontSize() * 2.2F)), 2, 8);
  if (plot.low && plot.high) return axisTicks(*plot.low, *plot.high, wanted, false);
  const AxisSpan fitted =
      fittedSpan(plot, data.known() ? std::optional(AxisSpan{data.low, data.high}) : std::nullopt);
  if (!data.known()) data = {fitted.low, fitted.high};
  for (const PlotLimit& limit : plot.limits) data.take(limit.at);
  if (memory.known) {
    const double span = std::max(memory.high - memory.low, 1e-12);
    // the axis shrinks only when the data needs less than half of it
    if (data.low >= memory.low && data.high <= memory.high && fitted.high - fitted.low > 0.45 * span)
      return axisTicks(plot.low.value_or(memory.low), plot.high.value_or(memory.high), wanted, false);
  }
  // the data with a margin, in quarters of a step, so that the axis does not move with every new maximum
  const double air = 0.05 * (fitted.high - fitted.low);
  const double quarter = axisTicks(fitted.low, fitted.high, wanted, false).step / 4;
  const double low = fitted.low == 0 ? 0 : std::floor((fitted.low - air) / quarter) * quarter;
  const double high = fitted.high == 0 ? 0 : std::ceil((fitted.high + air) / quarter) * quarter;
  AxisTicks ticks = axisTicks(plot.low.value_or(low), plot.high.value_or(high), wanted, false);
  memory.low = ticks.low;
  memory.high = ticks.high;
  memory.known = true;
  return ticks;
}

void drawAxes(ImDrawList& list, const PlotFrame& frame, const Plot& plot, bool show_x_axis) {
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
  const AxisTicks x = axisTicks(frame.from, frame.to, wanted, false, plot.clock_axis ? 0 : 1);
  for (const double value : x.at) {
    const float x_px = frame.xAt(value);
    list.AddLine({x_px, frame.low_px.y}, {x_px, frame.high_px.y}, line);
    if (!show_x_axis) continue;
    std::string text = plot.clock_axis ? clockText(value, x.step < 1 ? 1 : 0) : tickText(value, x.decimals);
    if (!plot.clock_axis && value == x.at.back() && !plot.x_unit.empty()) text += " " + plot.x_unit;
    const float width_px = ImGui::CalcTextSize(text.c_str()).x;
    const float left_px = labelLeftAt({frame.low_px, frame.high_px}, x_px, width_px);
    drawPlotText(list, {left_px, frame.high_px.y + 3}, words, text);
  }
  list.AddRect(frame.low_px, frame.high_px, packed(kLineGrey));
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

PlotField plotFieldAt(ImVec2 at, ImVec2 size_px, bool show_x_axis) {
  const float text_px = fontOf(Letters::kSmall)->FontSize;
  return {{at.x + text_px * 3.1F, at.y + text_px * 1.35F},
          {at.x + size_px.x - 6, at.y + size_px.y - (show_x_axis ? text_px * 1.5F : 5)}};
}

float labelLeftAt(const PlotField& field, float x_px, float width_px) {
  constexpr float kBeyond_px = 8;  // how far a label may extend beyond the field
  const float left_px = field.low_px.x - kBeyond_px, right_px = field.high_px.x + kBeyond_px;
  const float at_px = std::min(x_px - width_px * 0.5F, right_px - width_px);
  return std::max(at_px, left_px);
}

PlotResult linePlot(const char* id, const Plot& plot, ImVec2 size_px, bool show_x_axis) {
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  if (size_px.x <= 0) size_px.x = rest.x;
  if (size_px.y <= 0) size_px.y = rest.y;
  const ImVec2 at = ImGui::GetCursorScreenPos();
  const PlotField field = plotFieldAt(at, size_px, show_x_axis);
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
  frame.from = plot.from;
  frame.to = plot.to > plot.from ? plot.to : plot.from + 1;
  frame.downward = plot.downward;

  // one column per pixel
  const auto count = static_cast<std::size_t>(frame.high_px.x - frame.low_px.x);
  std::vector<std::vector<PixelColumn>> columns(plot.series.size());
  PlotRange data;
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    columns[i].resize(count);
    fillSeries(plot.series[i], frame.from, frame.to, columns[i]);
    for (const PixelColumn& column : columns[i]) {
      if (column.empty()) continue;
      data.take(static_cast<double>(column.min));
      data.take(static_cast<double>(column.max));
    }
  }
  PlotMemory& memory = memoryOf(ImGui::GetID("memory"));
  memory.show(frame.from, frame.to);
  frame.y = rangeOf(plot, data, memory, frame.high_px.y - frame.low_px.y);
  const PlotResult result = mouseOn(frame);

  ImDrawList& list = *ImGui::GetWindowDrawList();
  solidRect(list, frame.low_px, frame.high_px, kWindowGrey);
  drawAxes(list, frame, plot, show_x_axis);
  ImGui::PushClipRect(frame.low_px, frame.high_px, true);
  drawBands(list, frame, plot.bands);
  // draw the first series last, on top
  for (std::size_t i = plot.series.size(); i-- > 0;)
    drawColumns(list, frame, plot, plot.series[i], columns[i]);
  drawLimits(list, frame, plot.limits);
  const float mouse_px = ImGui::GetIO().MousePos.x;
  drawMarks(list, frame, plot.marks, result.hovered ? &mouse_px : nullptr);
  std::optional<double> read = plot.cursor;
  if (plot.cursor)
    list.AddLine({frame.xAt(*plot.cursor), frame.low_px.y}, {frame.xAt(*plot.cursor), frame.high_px.y},
                 packed(kWhite, 0.9F), 2);
  if (result.hovered) {
    read = result.hover_x;
    list.AddLine({mouse_px, frame.low_px.y}, {mouse_px, frame.high_px.y}, packed(kWhite, 0.45F));
  }
  ImGui::PopClipRect();
  drawPlotLegend(list, {frame.low_px.x, at.y}, frame.high_px.x, plot, columns, read, frame.y.step);
  ImGui::PopID();
  ImGui::SetCursorScreenPos(at);
  ImGui::Dummy(size_px);
  return result;
}

PlotResult plotStack(const char* id, std::span<const Plot> plots, ImVec2 size_px) {
  const ImVec2 rest = ImGui::GetContentRegionAvail();
  if (size_px.x <= 0) size_px.x = rest.x;
  if (size_px.y <= 0) size_px.y = rest.y;
  float shares = 0;
  for (const Plot& plot : plots) shares += plot.share;
  if (plots.empty() || shares <= 0) return {};
  const float text_px = fontOf(Letters::kSmall)->FontSize;
  // the last plot has the x axis below it; its field is as large as the others
  const float heights_px = size_px.y - text_px * 1.5F;
  PlotResult all;
  ImGui::PushID(id);
  ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, ImVec2{0, 0});
  for (std::size_t i = 0; i < plots.size(); ++i) {
    const Plot& plot = plots[i];
    const bool last = i + 1 == plots.size();
    ImGui::PushID(static_cast<int>(i));
    const float height_px = heights_px * plot.share / shares + (last ? text_px * 1.5F : 0);
    const PlotResult one = linePlot("plot", plot, {size_px.x, height_px}, last);
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
    // At most one point per pixel: draws the maximum of the points that share one, so that no peak is lost.
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
