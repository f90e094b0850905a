#include "client/sim/accuracy/panel_layout.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "client/sim/accuracy/report.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr double kPoint_px = 8;  // half the width of a point's own box

PixelBox around(PixelPoint centre, double width, double height) {
  return {centre.x - width / 2, centre.y - height / 2, centre.x + width / 2, centre.y + height / 2};
}

// a logarithmic axis
struct LogAxis {
  double from = 1, to = 10;
  [[nodiscard]] double share(double value) const {
    return std::log(std::clamp(value, from, to) / from) / std::log(to / from);
  }
};

LogAxis axisOf(const std::vector<double>& values) {
  double least = 0, most = 0;
  for (const double value : values) {
    if (!(value > 0) || !std::isfinite(value)) continue;
    least = least == 0 ? value : std::min(least, value);
    most = std::max(most, value);
  }
  if (most == 0) return {};
  // room for names on both sides; a zero stands on the axis, below everything
  const bool zero = std::any_of(values.begin(), values.end(), [](double v) { return v == 0; });
  const double room = std::max(1.6, std::pow(most / least, 0.14));
  return {least / (zero ? 10 * room : room), most * room};
}

// the marks of an axis, with their texts
void addTics(const std::string& block, const LogAxis& axis, const std::string& unit, PlotBlocks& data) {
  const double decades = std::log10(axis.to / axis.from);
  const std::vector<double> steps = decades < 1.3   ? std::vector<double>{1, 1.5, 2, 3, 5, 7}
                                    : decades < 2.6 ? std::vector<double>{1, 2, 5}
                                                    : std::vector<double>{1};
  for (int power = static_cast<int>(std::floor(std::log10(axis.from))); std::pow(10, power) <= axis.to;
       ++power)
    for (const double step : steps) {
      const double at = step * std::pow(10, power);
      if (at >= axis.from && at <= axis.to) data.row(block, {at}, {siText(at, unit)});
    }
}

struct PanelFrame {
  LogAxis x, y;
  PixelBox box;  // of the axes
  [[nodiscard]] PixelPoint at(const PanelPoint& point) const {
    return {box.left + x.share(point.x) * (box.right - box.left),
            box.bottom + y.share(point.y) * (box.top - box.bottom)};
  }
};

constexpr double kLetter_px = 6.7;  // of the small font

// `text` in lines that fit into `width_px`
std::vector<std::string> linesIn(const std::string& text, double width_px) {
  const std::string all = wrapped(text, static_cast<std::size_t>(width_px / kLetter_px), "");
  std::vector<std::string> lines;
  for (std::size_t from = 0; from < all.size();) {
    const std::size_t end = std::min(all.find('\n', from), all.size());
    lines.push_back(all.substr(from, end - from));
    from = end + 1;
  }
  return lines;
}

// series' names: where each stands, in pixels from the left and in lines
struct LegendEntry {
  double left_px = 0;
  std::size_t line = 0;
};
std::vector<LegendEntry> legendOf(const Panel& panel, double width_px) {
  std::vector<LegendEntry> entries;
  if (panel.series.size() < 2) return entries;
  double left = 6;
  std::size_t line = 0;
  for (const std::string& name : panel.series) {
    const double width = 36 + kLetter_px * static_cast<double>(countCharacters(name));
    if (left > 6 && left + width > width_px) {
      left = 6;
      ++line;
    }
    entries.push_back({left, line});
    left += width;
  }
  return entries;
}

constexpr double kLine_px = 17, kLeft_px = 118, kRight_px = 22;
double axesWidth_px(const PanelPlace& place) {
  return place.width - kLeft_px - kRight_px;
}

PanelFrame frameOf(const Panel& panel, const PanelPlace& place) {
  std::vector<double> xs, ys;
  for (const PanelPoint& point : panel.points) {
    xs.push_back(point.x);
    ys.push_back(point.y);
  }
  if (panel.level) ys.push_back(*panel.level);
  PanelFrame frame{axisOf(xs), axisOf(ys), {}};
  const auto legend = legendOf(panel, axesWidth_px(place));
  const std::size_t lines =
      linesIn(panel.under_title, axesWidth_px(place)).size() + (legend.empty() ? 0 : legend.back().line + 1);
  frame.box = {place.left + kLeft_px, place.bottom + 66, place.left + place.width - kRight_px,
               place.bottom + place.height - 52 - kLine_px * static_cast<double>(lines)};
  return frame;
}

// the front of a series, from its cheapest point to the right edge; in axes' units
std::vector<std::pair<double, double>> frontOf(const Panel& panel, const PanelFrame& frame,
                                               std::size_t series) {
  std::vector<std::pair<double, double>> front;
  for (const PanelPoint& point : panel.points)
    if (point.series == series && point.front)
      front.emplace_back(std::clamp(point.x, frame.x.from, frame.x.to),
                         std::clamp(point.y, frame.y.from, frame.y.to));
  std::sort(front.begin(), front.end());
  // costs within the noise count as equal, so the line may pass below a point that time alone puts further
  // left
  for (std::size_t i = 1; i < front.size(); ++i)
    front[i].second = std::min(front[i].second, front[i - 1].second);
  // the front continues beyond its costliest point: more time gives no less error
  if (!front.empty()) front.emplace_back(frame.x.to, front.back().second);
  return front;
}

std::size_t seriesCount(const Panel& panel) {
  std::size_t count = 1;
  for (const PanelPoint& point : panel.points) count = std::max(count, point.series + 1);
  return count;
}

// fronts, bars and the level's name, as boxes that names should not cover
std::vector<PixelBox> linesOf(const Panel& panel, const PanelFrame& frame) {
  std::vector<PixelBox> lines;
  const auto at = [&](double x, double y) {
    PanelPoint point;
    point.x = x, point.y = y;
    return frame.at(point);
  };
  const auto box = [&](PixelPoint a, PixelPoint b) {
    lines.push_back(
        {std::min(a.x, b.x) - 2, std::min(a.y, b.y) - 2, std::max(a.x, b.x) + 2, std::max(a.y, b.y) + 2});
  };
  for (std::size_t s = 0; s < seriesCount(panel); ++s) {
    const auto front = frontOf(panel, frame, s);
    for (std::size_t i = 1; i < front.size(); ++i) {
      const PixelPoint corner = at(front[i].first, front[i - 1].second);
      box(at(front[i - 1].first, front[i - 1].second), corner);
      box(corner, at(front[i].first, front[i].second));
    }
  }
  for (const PanelPoint& point : panel.points)
    if (point.spread) box(at(point.x, point.y - *point.spread), at(point.x, point.y + *point.spread));
  if (panel.level) {
    box(at(frame.x.from, *panel.level), at(frame.x.to, *panel.level));
    const PixelPoint end = at(frame.x.to, *panel.level);
    lines.push_back({end.x - 7.5 * static_cast<double>(panel.level_name.size()), end.y, end.x, end.y + 18});
  }
  return lines;
}

// title, comparison, and the series' names
void addTexts(const Panel& panel, const PanelPlace& place, const PanelFrame& frame, PlotBlocks& data) {
  const double top = place.bottom + place.height;
  data.row("titles", {frame.box.left, top - 18}, {panel.title});
  double y = top - 38;
  for (const std::string& line : linesIn(panel.under_title, axesWidth_px(place))) {
    data.row("captions", {frame.box.left, y}, {line});
    y -= kLine_px;
  }
  y -= 5;
  const auto legend = legendOf(panel, axesWidth_px(place));
  for (std::size_t s = 0; s < legend.size(); ++s)
    data.row("legend",
             {frame.box.left + legend[s].left_px, y - kLine_px * static_cast<double>(legend[s].line),
              static_cast<double>(s)},
             {" " + panel.series[s]});
}

// labels of points, and lines to labels far from their points
void addNames(const Panel& panel, const PanelFrame& frame, PlotBlocks& data) {
  std::vector<PixelPoint> points;
  std::vector<std::string> labels;
  for (const PanelPoint& point : panel.points) {
    points.push_back(frame.at(point));
    labels.push_back(point.label);
  }
  for (const PlacedLabel& placed : placeLabels(points, labels, {frame.box, linesOf(panel, frame), 8.3, 15})) {
    const PixelBox& box = placed.box;
    const double middle = (box.bottom + box.top) / 2;
    data.row("names",
             {(box.left + box.right) / 2, middle, static_cast<double>(panel.points[placed.point].series)},
             {labels[placed.point]});
    if (!placed.needs_line) continue;
    const PixelPoint& from = points[placed.point];
    const double x = std::clamp(from.x, box.left, box.right);
    const double y = middle > from.y ? box.bottom : box.top;
    data.row("leads", {from.x, from.y, x - from.x, y - from.y});
  }
}

// the points of each series, filled and hollow, their bars, and its front
void addPoints(const Panel& panel, const PanelFrame& frame, std::size_t number, PlotBlocks& data) {
  const auto block = [&](const char* name) { return fmt::format("{} {}", name, number); };
  for (std::size_t s = 0; s < seriesCount(panel); ++s) {
    const auto series = static_cast<double>(s);
    for (const PanelPoint& point : panel.points) {
      if (point.series != s) continue;
      const double x = std::clamp(point.x, frame.x.from, frame.x.to);
      const double y = std::clamp(point.y, frame.y.from, frame.y.to), spread = point.spread.value_or(0);
      data.row(block(point.fits ? "filled" : "hollow"), {x, y, series});
      if (spread > 0 && point.y > 0)
        data.row(block("bars"), {x, y, std::clamp(y - spread, frame.y.from, y), y + spread, series});
      if (point.x_range)
        data.row(block("xbars"), {x, y, std::clamp(point.x_range->first, frame.x.from, x),
                                  std::clamp(point.x_range->second, x, frame.x.to), series});
    }
    for (const auto& [x, y] : frontOf(panel, frame, s))
      data.row(fmt::format("front {} {}", number, s), {x, y});
  }
}

}  // namespace

std::string newtonText(double force_N, int figures) {
  if (force_N == 0 || !std::isfinite(force_N)) return fmt::format("{:g} N", std::abs(force_N));
  const int before = static_cast<int>(std::floor(std::log10(std::abs(force_N)))) + 1;
  std::string text = fixedText(force_N, std::max(0, figures - before));
  if (text.find('.') != std::string::npos) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
  }
  return text + " N";
}

std::string siText(double value, const std::string& unit) {
  if (value == 0) return "0 " + unit;
  if (unit == "N") return newtonText(value, 3);
  struct Prefix {
    double size;
    const char* name;
  };
  static constexpr std::array<Prefix, 8> kPrefixes = {
      {{1e9, "G"}, {1e6, "M"}, {1e3, "k"}, {1, ""}, {1e-3, "m"}, {1e-6, "µ"}, {1e-9, "n"}, {1e-12, "p"}}};
  for (const Prefix& prefix : kPrefixes) {
    // rounding to three figures must not give 1000 of the smaller unit
    if (std::abs(value) < prefix.size * 0.9995 && prefix.size > 1e-12) continue;
    std::string out = fmt::format("{:.3g} {}{}", value / prefix.size, prefix.name, unit);
    while (!out.empty() && out.back() == ' ') out.pop_back();
    return out;
  }
  return {};
}

void addPanel(const Panel& panel, const PanelPlace& place, std::size_t number, PlotBlocks& data) {
  if (panel.points.empty()) return;
  const PanelFrame frame = frameOf(panel, place);
  // a level outside of the axis is not shown
  const bool level = panel.level && frame.y.from < *panel.level && *panel.level < frame.y.to;
  data.row("panels",
           {static_cast<double>(number), frame.box.left, frame.box.bottom, frame.box.right, frame.box.top,
            frame.x.from, frame.x.to, frame.y.from, frame.y.to, level ? *panel.level : 0},
           {panel.x_title, panel.y_title, level ? panel.level_name : "none"});
  addTics(fmt::format("xtics {}", number), frame.x, panel.x_unit, data);
  addTics(fmt::format("ytics {}", number), frame.y, panel.y_unit, data);
  addTexts(panel, place, frame, data);
  addNames(panel, frame, data);
  addPoints(panel, frame, number, data);
}

std::vector<PlacedLabel> placeLabels(const std::vector<PixelPoint>& points,
                                     const std::vector<std::string>& labels, const LabelSpace& space) {
  // above right and below left first: a front goes from there to the right and downward
  static constexpr std::array<PixelPoint, 8> kSides = {
      {{1, 1}, {-1, -1}, {1, 0}, {-1, 0}, {1, -1}, {-1, 1}, {0, 1}, {0, -1}}};
  static constexpr std::array<double, 9> kGaps_px = {0, 10, 22, 36, 52, 70, 90, 115, 145};

  std::vector<PixelBox> taken;
  for (const PixelPoint& point : points) taken.push_back(around(point, 2 * kPoint_px, 2 * kPoint_px));
  const auto isFree = [&](const PixelBox& box, const std::vector<PixelBox>& among) {
    return std::none_of(among.begin(), among.end(), [&](const PixelBox& b) { return b.overlaps(box); });
  };

  std::vector<PlacedLabel> placed;
  const auto place = [&](std::size_t i, bool may_cover_lines) {
    const double width = space.letter_px * static_cast<double>(countCharacters(labels[i])),
                 height = space.line_px;
    for (std::size_t g = 0; g < kGaps_px.size(); ++g)
      for (const PixelPoint& side : kSides) {
        const double reach = kPoint_px + 1 + kGaps_px[g];
        const PixelBox box = around(
            {points[i].x + side.x * (reach + width / 2), points[i].y + side.y * (reach * 0.6 + height / 2)},
            width, height);
        if (!box.within(space.frame) || !isFree(box, taken)) continue;
        if (!may_cover_lines && !isFree(box, space.lines)) continue;
        taken.push_back(box);
        placed.push_back({i, box, g > 1});
        return true;
      }
    return false;
  };
  for (std::size_t i = 0; i < points.size(); ++i)
    if (!labels[i].empty() && !place(i, false)) place(i, true);
  return placed;
}

}  // namespace needlelab
