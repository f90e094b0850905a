#include "client/sim/accuracy/plot_panel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "client/sim/accuracy/label_layout.h"
#include "client/sim/accuracy/report.h"
#include "client/sim/tools/figure_table.h"

namespace needlelab {
namespace {

// Okabe and Ito's colours, told apart by colour-blind people too; the shape says it again
struct Look {
  const char* colour;
  int filled, hollow;
};
constexpr std::array<Look, 6> kLooks = {{{"#0072B2", 7, 6},
                                         {"#D55E00", 5, 4},
                                         {"#009E73", 9, 8},
                                         {"#CC79A7", 13, 12},
                                         {"#7A5C00", 11, 10},
                                         {"#56B4E9", 15, 14}}};
const Look& lookOf(std::size_t series) {
  return kLooks[series % kLooks.size()];
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

std::string tics(const LogAxis& axis, const std::string& unit) {
  const double decades = std::log10(axis.to / axis.from);
  const std::vector<double> steps = decades < 1.3   ? std::vector<double>{1, 1.5, 2, 3, 5, 7}
                                    : decades < 2.6 ? std::vector<double>{1, 2, 5}
                                                    : std::vector<double>{1};
  std::string text;
  for (int power = static_cast<int>(std::floor(std::log10(axis.from))); std::pow(10, power) <= axis.to;
       ++power)
    for (const double step : steps) {
      const double at = step * std::pow(10, power);
      if (at < axis.from || at > axis.to) continue;
      char place[40];
      std::snprintf(place, sizeof place, " %.6g", at);
      text += (text.empty() ? "" : ", ") + quoted(siText(at, unit)) + place;
    }
  return "(" + text + ")";
}

struct Frame {
  LogAxis x, y;
  PixelBox box;  // of the axes
  [[nodiscard]] PixelPoint at(const PanelPoint& point) const {
    return {box.left + x.share(point.x) * (box.right - box.left),
            box.bottom + y.share(point.y) * (box.top - box.bottom)};
  }
};

constexpr double kLetter_px = 6.7;  // of the small font

std::size_t letters(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0u) != 0x80u; }));
}

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
    const double width = 36 + kLetter_px * static_cast<double>(letters(name));
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

Frame frameOf(const Panel& panel, const PanelPlace& place) {
  std::vector<double> xs, ys;
  for (const PanelPoint& point : panel.points) {
    xs.push_back(point.x);
    ys.push_back(point.y);
  }
  if (panel.level) ys.push_back(*panel.level);
  Frame frame{axisOf(xs), axisOf(ys), {}};
  const auto legend = legendOf(panel, axesWidth_px(place));
  const std::size_t lines =
      linesIn(panel.under_title, axesWidth_px(place)).size() + (legend.empty() ? 0 : legend.back().line + 1);
  frame.box = {place.left + kLeft_px, place.bottom + 66, place.left + place.width - kRight_px,
               place.bottom + place.height - 52 - kLine_px * static_cast<double>(lines)};
  return frame;
}

std::string screen(double x_px, double y_px, const PanelPlace& place) {
  return "screen " + fixed(x_px / place.picture_width, 5) + ", screen " +
         fixed(y_px / place.picture_height, 5);
}

// `font` is a size, with B before it in bold
std::string label(const std::string& text, const std::string& at, const char* align, std::string font,
                  const char* colour) {
  const bool bold = font.front() == 'B';
  if (bold) font.erase(0, 1);
  return "set label " + quoted(text) + " at " + at + " " + align + " noenhanced front font 'DejaVu Sans" +
         (bold ? " Bold," : ",") + font + "' textcolor rgb '" + colour + "'\n";
}

std::string axes(const Panel& panel, const PanelPlace& place, const Frame& frame) {
  const auto margin = [&](const char* side, double px, double whole) {
    return std::string("set ") + side + " at screen " + fixed(px / whole, 5) + "\n";
  };
  std::string text = "unset label\nunset arrow\nunset object\nunset key\nset logscale xy\n";
  text += margin("lmargin", frame.box.left, place.picture_width) +
          margin("rmargin", frame.box.right, place.picture_width) +
          margin("bmargin", frame.box.bottom, place.picture_height) +
          margin("tmargin", frame.box.top, place.picture_height);
  char range[160];
  std::snprintf(range, sizeof range, "set xrange [%.8g:%.8g]\nset yrange [%.8g:%.8g]\n", frame.x.from,
                frame.x.to, frame.y.from, frame.y.to);
  text += range;
  text += "set xtics nomirror " + tics(frame.x, panel.x_unit) + "\nset ytics nomirror " +
          tics(frame.y, panel.y_unit) + "\n";
  text += "set xlabel " + quoted(panel.x_title) + " noenhanced\nset ylabel " + quoted(panel.y_title) +
          " noenhanced\n";
  const double top = place.bottom + place.height;
  text += label(panel.title, screen(frame.box.left, top - 18, place), "left", "B13", "#1c2329");
  double y = top - 38;
  for (const std::string& line : linesIn(panel.under_title, axesWidth_px(place))) {
    text += label(line, screen(frame.box.left, y, place), "left", "10", "#4a5560");
    y -= kLine_px;
  }
  y -= 5;
  const auto legend = legendOf(panel, axesWidth_px(place));
  for (std::size_t s = 0; s < legend.size(); ++s)
    text += "set label " + quoted(" " + panel.series[s]) + " at " +
            screen(frame.box.left + legend[s].left_px, y - kLine_px * static_cast<double>(legend[s].line),
                   place) +
            " left noenhanced font 'DejaVu Sans,10' point pt " + std::to_string(lookOf(s).filled) +
            " ps 1.1 lc rgb '" + lookOf(s).colour + "' offset 0.6,0\n";
  return text;
}

// the front of a series, from its cheapest point to the right edge; in axes' units
std::vector<std::pair<double, double>> frontOf(const Panel& panel, const Frame& frame, std::size_t series) {
  std::vector<std::pair<double, double>> front;
  for (const PanelPoint& point : panel.points)
    if (point.series == series && point.front)
      front.emplace_back(std::clamp(point.x, frame.x.from, frame.x.to),
                         std::clamp(point.y, frame.y.from, frame.y.to));
  std::sort(front.begin(), front.end());
  // beyond its dearest point it goes on: more time gives no less error
  if (!front.empty()) front.emplace_back(frame.x.to, front.back().second);
  return front;
}

std::size_t seriesCount(const Panel& panel) {
  std::size_t count = 1;
  for (const PanelPoint& point : panel.points) count = std::max(count, point.series + 1);
  return count;
}

// fronts, bars and the level's name, as boxes that names should not cover
std::vector<PixelBox> linesOf(const Panel& panel, const Frame& frame) {
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

std::string names(const Panel& panel, const PanelPlace& place, const Frame& frame) {
  std::vector<PixelPoint> points;
  std::vector<std::string> labels;
  for (const PanelPoint& point : panel.points) {
    points.push_back(frame.at(point));
    labels.push_back(point.label);
  }
  std::string text;
  for (const PlacedLabel& placed : placeLabels(points, labels, {frame.box, linesOf(panel, frame), 8.3, 15})) {
    const PixelBox& box = placed.box;
    const double middle = (box.bottom + box.top) / 2;
    text += label(labels[placed.point], screen((box.left + box.right) / 2, middle, place), "center", "10",
                  lookOf(panel.points[placed.point].series).colour);
    if (!placed.needs_line) continue;
    const PixelPoint& from = points[placed.point];
    const double x = std::clamp(from.x, box.left, box.right);
    const double y = middle > from.y ? box.bottom : box.top;
    text += "set arrow from " + screen(from.x, from.y, place) + " to " + screen(x, y, place) +
            " nohead lc rgb '#9aa4ad' lw 0.8 back\n";
  }
  return text;
}

// data blocks: the points of each series, filled and hollow, and its front
struct Drawn {
  std::string blocks;
  std::vector<std::string> plots;
};

std::string rowText(double x, double y, double low, double high) {
  char text[120];
  std::snprintf(text, sizeof text, "%.9g,%.9g,%.9g,%.9g\n", x, y, low, high);
  return text;
}

void addBlock(Drawn& drawn, const std::string& name, const std::string& rows, const std::string& how) {
  if (rows.empty()) return;
  drawn.blocks += "$" + name + " << EOD\n" + rows + "EOD\n";
  drawn.plots.push_back("$" + name + " using " + how);
}

Drawn drawnOf(const Panel& panel, const Frame& frame, std::size_t number) {
  Drawn drawn;
  for (std::size_t s = 0; s < seriesCount(panel); ++s) {
    const Look& look = lookOf(s);
    std::string filled, hollow, bars;
    for (const PanelPoint& point : panel.points) {
      if (point.series != s) continue;
      const double x = std::clamp(point.x, frame.x.from, frame.x.to);
      const double y = std::clamp(point.y, frame.y.from, frame.y.to), spread = point.spread.value_or(0);
      const std::string row = rowText(x, y, std::clamp(y - spread, frame.y.from, y), y + spread);
      (point.fits ? filled : hollow) += row;
      if (spread > 0 && point.y > 0) bars += row;
    }
    std::string steps;
    for (const auto& [x, y] : frontOf(panel, frame, s)) steps += rowText(x, y, y, y);
    const std::string id = std::to_string(number) + "_" + std::to_string(s);
    const std::string colour = std::string(" lc rgb '") + look.colour + "'";
    addBlock(drawn, "front" + id, steps, "1:2 with steps" + colour + " lw 1.6 dt (8,5) notitle");
    addBlock(drawn, "bars" + id, bars, "1:2:3:4 with yerrorbars" + colour + " lw 1 pt 0 notitle");
    addBlock(drawn, "filled" + id, filled,
             "1:2 with points pt " + std::to_string(look.filled) + " ps 1.5" + colour + " notitle");
    addBlock(drawn, "hollow" + id, hollow,
             "1:2 with points pt " + std::to_string(look.hollow) + " ps 1.5 lw 2" + colour + " notitle");
  }
  return drawn;
}

std::string levelScript(const Panel& panel, const Frame& frame) {
  if (!panel.level) return {};
  char text[400];
  std::snprintf(text, sizeof text,
                "set arrow from graph 0, first %.6g to graph 1, first %.6g nohead ls 6 back\n"
                "set label %s at graph 0.995, first %.6g right offset 0,0.5 noenhanced font 'DejaVu Sans,9' "
                "textcolor rgb '#5f6a73'\n",
                *panel.level, *panel.level, quoted(panel.level_name).c_str(), *panel.level);
  return frame.y.from < *panel.level && *panel.level < frame.y.to ? text : "";
}

}  // namespace

std::string siText(double value, const std::string& unit) {
  if (value == 0) return "0 " + unit;
  struct Prefix {
    double size;
    const char* name;
  };
  static constexpr std::array<Prefix, 8> kPrefixes = {
      {{1e9, "G"}, {1e6, "M"}, {1e3, "k"}, {1, ""}, {1e-3, "m"}, {1e-6, "µ"}, {1e-9, "n"}, {1e-12, "p"}}};
  for (const Prefix& prefix : kPrefixes) {
    // rounding to three figures must not give 1000 of the smaller unit
    if (std::abs(value) < prefix.size * 0.9995 && prefix.size > 1e-12) continue;
    char text[48];
    std::snprintf(text, sizeof text, "%.3g %s%s", value / prefix.size, prefix.name, unit.c_str());
    std::string out = text;
    while (!out.empty() && out.back() == ' ') out.pop_back();
    return out;
  }
  return {};
}

std::string panelScript(const Panel& panel, const PanelPlace& place, std::size_t number) {
  if (panel.points.empty()) return {};
  const Frame frame = frameOf(panel, place);
  const Drawn drawn = drawnOf(panel, frame, number);
  std::string text = axes(panel, place, frame) + levelScript(panel, frame) + names(panel, place, frame) +
                     drawn.blocks + "plot ";
  for (std::size_t i = 0; i < drawn.plots.size(); ++i) text += (i > 0 ? ", \\\n     " : "") + drawn.plots[i];
  return text + "\n";
}

}  // namespace needlelab
