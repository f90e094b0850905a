#include "client/instructor/model/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "client/instructor/model/html_text.h"
#include "client/view/model/axis_ticks.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr double kWidth = 720, kHeight = 200, kLeft = 56, kRight = 12, kTop = 26, kBottom = 34;
constexpr double kLegendLetter = 7, kHeadingLetter = 8;  // px, of 11 and 12 px letters, rather too wide
constexpr std::size_t kColumns = static_cast<std::size_t>(kWidth - kLeft - kRight);

/// Where numbers come to lie.
struct SvgFrame {
  double from = 0, to = 1, low = 0, high = 1;
  bool downward = false;
  [[nodiscard]] double x(double value) const {
    return kLeft + (value - from) / (to - from) * (kWidth - kLeft - kRight);
  }
  [[nodiscard]] double y(double value) const {
    const double share = (value - low) / (high - low);
    return kTop + (downward ? share : 1 - share) * (kHeight - kTop - kBottom);
  }
};

std::string text(double x, double y, const char* anchor, const std::string& words,
                 const std::string& more = {}) {
  return formatted("<text x='%.1f' y='%.1f' text-anchor='%s'%s>", x, y, anchor, more.c_str()) +
         htmlText(words) + "</text>";
}

std::string line(double x1, double y1, double x2, double y2, const char* kind) {
  return formatted("<line x1='%.1f' y1='%.1f' x2='%.1f' y2='%.1f' class='%s'/>", x1, y1, x2, y2, kind);
}

/// Colours of the dark theme that are too pale for white paper become darker.
std::string inkOf(Rgb colour) {
  for (int i = 0; i < 12 && relativeLuminance(colour) > 0.40; ++i) colour = mixed(colour, kBlack, 0.12F);
  return hexText(colour);
}

/// A curve's points; what lies on the straight line between its neighbours is left out.
class CurvePath {
 public:
  void add(double x, double y) {
    if (last_ && before_ && std::abs(before_->second - last_->second) < 0.05 &&
        std::abs(last_->second - y) < 0.05) {
      last_->first = x;
      return;
    }
    put();
    before_ = last_;
    last_ = {x, y};
  }
  std::string text() {
    put();
    return std::move(text_);
  }

 private:
  void put() {
    if (last_) text_ += formatted("%s%.1f %.1f", text_.empty() ? "M" : "L", last_->first, last_->second);
  }
  std::optional<std::pair<double, double>> before_, last_;
  std::string text_;
};

std::string seriesPath(const SvgSeries& series, const std::vector<PixelColumn>& columns,
                       const SvgFrame& frame) {
  CurvePath path;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const PixelColumn& column = columns[i];
    if (column.empty()) continue;
    const double x = kLeft + static_cast<double>(i) + 0.5;
    const double a = frame.y(static_cast<double>(column.min)), b = frame.y(static_cast<double>(column.max));
    path.add(x, a);
    if (std::abs(a - b) > 0.3) path.add(x, b);
    if (column.last != column.max && column.last != column.min)
      path.add(x, frame.y(static_cast<double>(column.last)));
  }
  return "<path d='" + path.text() + "' stroke='" + inkOf(series.colour) + "'" +
         (series.dashed ? " stroke-dasharray='5 4'" : "") + " class='s'/>";
}

std::string axes(const SvgFrame& frame, const AxisTicks& x_ticks, const AxisTicks& y_ticks) {
  std::string out;
  for (const double at : y_ticks.at) {
    out += line(kLeft, frame.y(at), kWidth - kRight, frame.y(at), "g");
    out += text(kLeft - 6, frame.y(at) + 4, "end", tickText(at, y_ticks.decimals));
  }
  for (const double at : x_ticks.at) {
    out += line(frame.x(at), kHeight - kBottom, frame.x(at), kHeight - kBottom + 4, "a");
    out += text(frame.x(at), kHeight - kBottom + 16, "middle", tickText(at, x_ticks.decimals));
  }
  return out + line(kLeft, kHeight - kBottom, kWidth - kRight, kHeight - kBottom, "a");
}

/// The series' names with a piece of their lines, up to the right edge; no further left than `from`.
std::string legend(const std::vector<SvgSeries>& series, double from) {
  if (series.size() < 2) return {};
  std::size_t letters = 0;
  for (const SvgSeries& each : series) letters += each.name.size();
  const auto n = static_cast<double>(series.size());
  const double room = kWidth - kRight - from - kLegendLetter * static_cast<double>(letters);
  const double piece = std::clamp(room / n - 8, 8.0, 30.0);
  std::string out;
  double x = kWidth - kRight;
  for (auto each = series.rbegin(); each != series.rend(); ++each) {
    x -= kLegendLetter * static_cast<double>(each->name.size()) + 8;
    out += text(x, 14, "start", each->name);
    out +=
        formatted("<line x1='%.1f' y1='10' x2='%.1f' y2='10' stroke='%s' stroke-width='3'%s/>", x - piece + 8,
                  x - 4, inkOf(each->colour).c_str(), each->dashed ? " stroke-dasharray='5 4'" : "");
    x -= piece;
  }
  return out;
}

std::string openSvg(double width, double height, const std::string& label) {
  return formatted("<svg viewBox='0 0 %.0f %.0f' width='%.0f' height='%.0f' role='img' aria-label='", width,
                   height, width, height) +
         htmlText(label) + "'>";
}

}  // namespace

std::string svgPlot(const SvgPlot& plot) {
  SvgFrame frame;
  frame.from = plot.from;
  frame.to = plot.to > plot.from ? plot.to : plot.from + 1;
  frame.downward = plot.downward;
  // what there is decides about the axis
  std::vector<std::vector<PixelColumn>> columns(plot.series.size(), std::vector<PixelColumn>(kColumns));
  double low = 0, high = 0;
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    plot.series[i].columns(frame.from, frame.to, columns[i]);
    for (const PixelColumn& column : columns[i]) {
      if (column.empty()) continue;
      low = std::min(low, static_cast<double>(column.min));
      high = std::max(high, static_cast<double>(column.max));
    }
  }
  const AxisTicks y_ticks = axisTicks(low, high > low ? high : low + 1, 5, true);
  const AxisTicks x_ticks = axisTicks(frame.from, frame.to, 9, false);
  frame.low = y_ticks.low;
  frame.high = y_ticks.high;

  std::string out = openSvg(kWidth, kHeight, plot.title);
  for (const SvgBand& band : plot.bands) {
    const double a = std::clamp(band.low, frame.low, frame.high),
                 b = std::clamp(band.high, frame.low, frame.high);
    if (!(b > a)) continue;
    const double top = std::min(frame.y(a), frame.y(b)), height = std::abs(frame.y(a) - frame.y(b));
    out += formatted("<rect x='%.1f' y='%.1f' width='%.1f' height='%.1f' fill='%s' fill-opacity='.28'/>",
                     kLeft, top, kWidth - kLeft - kRight, height, hexText(band.colour).c_str());
    if (height > 11) out += text(kWidth - kRight - 4, top + height / 2 + 4, "end", band.name, " class='q'");
  }
  out += axes(frame, x_ticks, y_ticks);
  for (std::size_t i = 0; i < plot.series.size(); ++i) out += seriesPath(plot.series[i], columns[i], frame);
  for (const SvgMark& mark : plot.marks) {
    if (mark.x < frame.from || mark.x > frame.to) continue;
    out += "<g>" + line(frame.x(mark.x), kTop, frame.x(mark.x), kHeight - kBottom, "m") +
           text(frame.x(mark.x), kTop - 2, "middle", mark.sign) + "<title>" + htmlText(mark.text) +
           "</title></g>";
  }
  // heading, and the legend right of it: closer together where it would run into the heading
  const std::string heading = plot.title + (plot.unit.empty() ? "" : ", " + plot.unit);
  out += text(kLeft, 14, "start", heading, " class='h'");
  out += legend(plot.series, kLeft + kHeadingLetter * static_cast<double>(heading.size()) + 12);
  out += text(kWidth - kRight, kHeight - 4, "end", plot.x_title);
  return out + "</svg>";
}

std::string svgProgress(const SvgProgress& progress) {
  constexpr double kWide = 340, kHigh = 130, kX = 52, kY = 22, kW = 276, kH = 80;
  double low = 0, high = 0;
  if (progress.band_high > progress.band_low)
    high = progress.band_high, low = std::min(0.0, progress.band_low);
  for (const double v : progress.values) low = std::min(low, v), high = std::max(high, v);
  const AxisTicks ticks = axisTicks(low, high > low ? high : low + 1, 4, true);
  const double last = std::max(2.0, progress.attempts.empty() ? 2.0 : progress.attempts.back());
  const auto x = [&](double attempt) { return kX + (attempt - 1) / (last - 1) * kW; };
  const auto y = [&](double value) { return kY + (1 - (value - ticks.low) / (ticks.high - ticks.low)) * kH; };
  std::string out = openSvg(kWide, kHigh, progress.title);
  if (progress.band_high > progress.band_low) {
    const double top = y(std::min(progress.band_high, ticks.high)),
                 end = y(std::max(progress.band_low, ticks.low));
    out += formatted("<rect x='%.1f' y='%.1f' width='%.1f' height='%.1f' fill='%s' fill-opacity='.2'/>", kX,
                     top, kW, std::max(1.0, end - top), hexText(kBluishGreen).c_str());
  }
  for (const double at : ticks.at) {
    out +=
        line(kX, y(at), kX + kW, y(at), "g") + text(kX - 5, y(at) + 4, "end", tickText(at, ticks.decimals));
  }
  std::string path;
  for (std::size_t i = 0; i < progress.values.size() && i < progress.attempts.size(); ++i) {
    const double px = x(progress.attempts[i]), py = y(progress.values[i]);
    path += formatted("%s%.1f %.1f", path.empty() ? "M" : "L", px, py);
    out += formatted("<circle cx='%.1f' cy='%.1f' r='3.5' fill='%s'/>", px, py, hexText(kBlue).c_str());
  }
  out += "<path d='" + path + "' stroke='" + hexText(kBlue) + "' class='s'/>";
  out += text(kX, 13, "start", progress.title + (progress.unit.empty() ? "" : ", " + progress.unit),
              " class='h'");
  out += text(kX, kHigh - 6, "middle", "1") + text(kX + kW, kHigh - 6, "middle", formatted("%.0f", last)) +
         text(kX + kW / 2, kHigh - 6, "middle", "attempt");
  return out + "</svg>";
}

std::string svgStanding(const SvgStanding& s) {
  constexpr double kW = 180, kH = 18;
  const double low = std::min({s.least, s.value}), high = std::max({s.greatest, s.value});
  const double width = high > low ? high - low : 1;
  const auto x = [&](double value) { return 6 + (std::clamp(value, low, high) - low) / width * (kW - 12); };
  std::string out = openSvg(kW, kH, "beside the reference");
  out += formatted("<rect x='%.1f' y='6' width='%.1f' height='6' fill='#ccd3da'/>", x(s.least),
                   std::max(1.0, x(s.greatest) - x(s.least)));
  if (s.p90 > s.p10)
    out += formatted("<rect x='%.1f' y='4' width='%.1f' height='10' fill='%s' fill-opacity='.55'/>", x(s.p10),
                     std::max(1.0, x(s.p90) - x(s.p10)), hexText(kBluishGreen).c_str());
  out += formatted("<line x1='%.1f' y1='2' x2='%.1f' y2='16' stroke='#333' stroke-width='1.5'/>", x(s.mean),
                   x(s.mean));
  const double v = x(s.value);
  // a diamond: told apart from the mean by shape, not by colour alone
  out += formatted("<path d='M%.1f 9l4.5 -6l4.5 6l-4.5 6z' fill='%s' stroke='#fff'/>", v - 4.5,
                   hexText(kVermillion).c_str());
  return out + "</svg>";
}

}  // namespace needlelab
