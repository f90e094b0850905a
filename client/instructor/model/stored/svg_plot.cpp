#include "client/instructor/model/stored/report.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "client/view/model/palette.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

constexpr double kLeft = 56, kRight = 12, kTop = 26, kBottom = 34;  // around the field
constexpr double kLegendLetter = 7, kHeadingLetter = 8;  // px; generous widths of 11 and 12 px letters

/// Maps the plot's values to picture coordinates.
struct SvgFrame {
  SvgSize size;
  double from = 0, to = 1, low = 0, high = 1;
  bool downward = false;
  [[nodiscard]] double right() const { return size.width - kRight; }
  [[nodiscard]] double bottom() const { return size.height - kBottom; }
  [[nodiscard]] double x(double value) const {
    return kLeft + (value - from) / (to - from) * (right() - kLeft);
  }
  [[nodiscard]] double y(double value) const {
    const double share = std::clamp((value - low) / (high - low), 0.0, 1.0);
    return kTop + (downward ? share : 1 - share) * (bottom() - kTop);
  }
};

std::string textAt(double x, double y, std::string_view anchor, const std::string& text,
                   std::string_view attributes = {}) {
  return fmt::format("<text x='{:.1f}' y='{:.1f}' text-anchor='{}'{}>{}</text>", x, y, anchor, attributes,
                     htmlText(text));
}

std::string line(double x1, double y1, double x2, double y2, std::string_view kind) {
  return fmt::format("<line x1='{:.1f}' y1='{:.1f}' x2='{:.1f}' y2='{:.1f}' class='{}'/>", x1, y1, x2, y2,
                     kind);
}

/// Adapts a colour to white paper: white becomes black, pale colours become darker.
std::string inkOf(Rgb colour) {
  if (colour == kWhite) colour = kBlack;
  for (int i = 0; i < 12 && relativeLuminance(colour) > 0.40; ++i) colour = mixed(colour, kBlack, 0.12F);
  return hexText(colour);
}

/// Dashes every second curve when there are many, so that they differ in black-and-white print.
bool isDashed(const Plot& plot, std::size_t i) {
  return plot.series[i].dashed || (plot.series.size() > 3 && i > 0 && i % 2 == 0);
}

/// A curve's points, without those on the straight line between their neighbours.
class CurvePath {
 public:
  void add(double x, double y) {
    if (first_x_ > x) first_x_ = x;
    if (last_ && before_ && std::abs(before_->second - last_->second) < 0.05 &&
        std::abs(last_->second - y) < 0.05) {
      last_->first = x;
      return;
    }
    put();
    before_ = last_;
    last_ = {x, y};
  }
  /// The rest of the outline of the area between the curve and y.
  [[nodiscard]] std::string closedAt(double y) const {
    return last_ ? fmt::format("L{:.1f} {:.1f}L{:.1f} {:.1f}Z", last_->first, y, first_x_, y) : std::string();
  }
  std::string text() {
    put();
    return text_;
  }

 private:
  void put() {
    if (last_)
      text_ += fmt::format("{}{:.1f} {:.1f}", text_.empty() ? "M" : "L", last_->first, last_->second);
  }
  std::optional<std::pair<double, double>> before_, last_;
  double first_x_ = 1e9;
  std::string text_;
};

std::string drawnSeries(const Plot& plot, std::size_t number, std::span<const PixelColumn> columns,
                        const SvgFrame& frame) {
  const PlotSeries& series = plot.series[number];
  std::vector<CurvePath> runs(1);  // a gap starts another run
  std::optional<std::size_t> before;
  std::string out;
  const std::string ink = inkOf(series.colour);
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const PixelColumn& column = columns[i];
    if (column.empty()) continue;
    const auto isAbsent = [&](std::size_t column) {
      const double share = static_cast<double>(column) / static_cast<double>(columns.size());
      return series.reader && !series.reader(plot.from + share * (plot.to - plot.from));
    };
    if (before && (isBroken(plot, *before, i, columns.size()) || isAbsent((*before + i) / 2)))
      runs.emplace_back();
    before = i;
    CurvePath& path = runs.back();
    const double x = kLeft + static_cast<double>(i) + 0.5;
    const double a = frame.y(static_cast<double>(column.min)), b = frame.y(static_cast<double>(column.max));
    path.add(x, a);
    if (std::abs(a - b) > 0.3) path.add(x, b);
    if (column.last != column.max && column.last != column.min)
      path.add(x, frame.y(static_cast<double>(column.last)));
  }
  for (std::size_t i = 0; i < series.x.size() && i < series.y.size(); ++i) {
    const double x = frame.x(series.x[i]), y = frame.y(series.y[i]);
    runs.back().add(x, y);
    out += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='3.5' fill='{}'/>", x, y, ink);
  }
  std::string curve, area;
  for (CurvePath& run : runs) {
    const std::string text = run.text();
    curve += text;
    area += text + run.closedAt(frame.y(0));
  }
  if (series.filled) out += fmt::format("<path d='{}' fill='{}' fill-opacity='.16'/>", area, ink);
  return out + fmt::format("<path d='{}' stroke='{}'{} class='s'/>", curve, ink,
                           isDashed(plot, number) ? " stroke-dasharray='5 4'" : "");
}

std::string drawnBands(const Plot& plot, const SvgFrame& frame) {
  std::string out;
  for (const PlotBand& band : plot.bands) {
    const double a = std::clamp(band.low, frame.low, frame.high),
                 b = std::clamp(band.high, frame.low, frame.high);
    if (!(b > a) && !(band.is_target && band.low > frame.low && band.high < frame.high)) continue;
    const double top = std::min(frame.y(a), frame.y(b)),
                 height = std::max(std::abs(frame.y(a) - frame.y(b)), band.is_target ? 1.5 : 0);
    const auto within = [&](double x) { return std::clamp(frame.x(x), kLeft, frame.right()); };
    const double left = within(band.from), right = within(band.to), name_end = within(band.name_to);
    out += fmt::format(
        "<rect x='{:.1f}' y='{:.1f}' width='{:.1f}' height='{:.1f}' fill='{}' fill-opacity='{}'/>", left, top,
        right - left, height, hexText(band.colour), band.is_target ? ".5" : ".28");
    const bool has_room = kLegendLetter * static_cast<double>(band.name.size()) < name_end - left;
    if (band.name.empty() || !has_room || !(height > 11 || band.is_target)) continue;
    out += band.is_target ? textAt(left + 4, top + height / 2 + 4, "start", band.name)
                          : textAt(name_end - 4, top + height / 2 + 4, "end", band.name, " class='q'");
  }
  return out;
}

std::string drawnAxes(const Plot& plot, const SvgFrame& frame, const AxisTicks& y_ticks) {
  std::string out;
  for (const double at : y_ticks.at) {
    out += line(kLeft, frame.y(at), frame.right(), frame.y(at), "g");
    out += textAt(kLeft - 6, frame.y(at) + 4, "end", tickText(at, y_ticks.decimals));
  }
  const AxisTicks x_ticks = axisTicks(frame.from, frame.to, static_cast<int>(frame.size.width / 80), false,
                                      plot.clock_axis ? 0 : 1);
  for (const double at : x_ticks.at) {
    out += line(frame.x(at), frame.bottom(), frame.x(at), frame.bottom() + 4, "a");
    out += textAt(frame.x(at), frame.bottom() + 16, "middle", tickText(at, x_ticks.decimals));
  }
  return out + line(kLeft, frame.bottom(), frame.right(), frame.bottom(), "a");
}

/// Each limit as a dashed line, with its text at the right end: below the line, or above it near the lower
/// edge.
std::string drawnLimits(const Plot& plot, const SvgFrame& frame) {
  std::string out;
  for (const PlotLimit& limit : plot.limits) {
    const double y = frame.y(limit.at);
    out += fmt::format(
        "<line x1='{:.1f}' y1='{:.1f}' x2='{:.1f}' y2='{:.1f}' stroke='{}' stroke-dasharray='6 4'/>", kLeft,
        y, frame.right(), y, inkOf(kVermillion));
    out += textAt(frame.right() - 4, y + 14 < frame.bottom() ? y + 12 : y - 4, "end", limit.text);
  }
  return out;
}

std::string drawnMarks(const Plot& plot, const SvgFrame& frame) {
  std::string out;
  for (const PlotMark& mark : plot.marks) {
    if (mark.x < frame.from || mark.x > frame.to) continue;
    const double x = frame.x(mark.x);
    out += fmt::format("<g>{}{}<title>{}</title></g>", line(x, kTop, x, frame.bottom(), "m"),
                       textAt(x, kTop - 2, "middle", mark.sign), htmlText(mark.text));
  }
  return out;
}

/// The legend: names of the series with a piece of their lines, aligned to the right edge. Entries move
/// closer together if they would overlap the heading, which ends at `from`.
std::string drawnLegend(const Plot& plot, const SvgFrame& frame, double from) {
  if (!plot.legend || plot.series.size() < 2) return {};
  std::size_t letters = 0;
  for (const PlotSeries& each : plot.series) letters += each.name.size();
  const auto n = static_cast<double>(plot.series.size());
  const double room = frame.right() - from - kLegendLetter * static_cast<double>(letters);
  const double piece = std::clamp(room / n - 8, 8.0, 30.0);
  std::string out;
  double x = frame.right();
  for (std::size_t i = plot.series.size(); i-- > 0;) {
    const PlotSeries& each = plot.series[i];
    x -= kLegendLetter * static_cast<double>(each.name.size()) + 8;
    out += textAt(x, 14, "start", each.name);
    out += fmt::format("<line x1='{:.1f}' y1='10' x2='{:.1f}' y2='10' stroke='{}' stroke-width='3'{}/>",
                       x - piece + 8, x - 4, inkOf(each.colour),
                       isDashed(plot, i) ? " stroke-dasharray='5 4'" : "");
    x -= piece;
  }
  return out;
}

std::string openSvg(SvgSize size, const std::string& label) {
  return fmt::format(
      "<svg viewBox='0 0 {0:.0f} {1:.0f}' width='{0:.0f}' height='{1:.0f}' role='img' aria-label='{2}'>",
      size.width, size.height, htmlText(label));
}

}  // namespace

std::string htmlText(std::string_view text) {
  std::string out;
  for (const char c : printable(text)) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string svgPlot(const Plot& plot, SvgSize size) {
  SvgFrame frame{size, plot.from, plot.to > plot.from ? plot.to : plot.from + 1, 0, 1, plot.downward};
  // the axis includes all data and zero
  std::vector<std::vector<PixelColumn>> columns(plot.series.size());
  double low = 0, high = 0;
  const auto take = [&](double value) { low = std::min(low, value), high = std::max(high, value); };
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    for (const double value : plot.series[i].y) take(value);
    if (!plot.series[i].columns) continue;
    columns[i].resize(static_cast<std::size_t>(std::max(1.0, frame.right() - kLeft)));
    plot.series[i].columns(frame.from, frame.to, columns[i]);
    for (const PixelColumn& column : columns[i]) {
      if (column.empty()) continue;
      take(static_cast<double>(column.min));
      take(static_cast<double>(column.max));
    }
  }
  const AxisSpan fitted = fittedSpan(plot, AxisSpan{low, high});
  const AxisTicks ticks = axisTicks(fitted.low, fitted.high > fitted.low ? fitted.high : fitted.low + 1,
                                    size.height < 160 ? 4 : 5, true);
  frame.low = ticks.low;
  frame.high = ticks.high;

  std::string out = openSvg(size, plot.title) + drawnBands(plot, frame) + drawnAxes(plot, frame, ticks);
  for (std::size_t i = plot.series.size(); i-- > 0;) out += drawnSeries(plot, i, columns[i], frame);
  out += drawnLimits(plot, frame) + drawnMarks(plot, frame);
  const std::string heading = headingOf(plot);
  out += textAt(kLeft, 14, "start", heading, " class='h'");
  out += drawnLegend(plot, frame, kLeft + kHeadingLetter * static_cast<double>(heading.size()) + 12);
  return out + textAt(frame.right(), size.height - 4, "end", plot.clock_axis ? "s" : plot.x_unit) + "</svg>";
}

std::string svgPlace(const PlaceMarks& marks) {
  constexpr double kW = 180, kH = 18;
  std::string out = openSvg({kW, kH}, "beside the experts");
  out += fmt::format("<rect x='{:.1f}' y='4' width='{:.1f}' height='10' fill='{}' fill-opacity='.55'/>",
                     kW * marks.least, std::max(1.0, kW * (marks.greatest - marks.least)),
                     hexText(kBluishGreen));
  const double v = kW * marks.value;
  // a diamond: differs from the range by shape, not only colour
  out += fmt::format("<path d='M{:.1f} 9l4.5 -6l4.5 6l-4.5 6z' fill='{}' stroke='#fff'/>", v - 4.5,
                     hexText(kVermillion));
  return out + "</svg>";
}

}  // namespace needlelab
