#include "client/sim/stability_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "client/sim/stability/case_output.h"
#include "client/sim/tools/figure_table.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files.h"

namespace needlelab {
namespace {

// blue, orange, dark: told apart without colour sight, and in print
struct Look {
  const char* fill;
  const char* text;
};
Look lookOf(const CaseRow* row) {
  if (row == nullptr || !row->applicable) return {"#f3f4f5", "#9aa3ab"};
  switch (row->verdict) {
    case Verdict::kStable:
      return {"#cfe2f3", "#16324f"};
    case Verdict::kChatters:
      return {"#f6b26b", "#3b2405"};
    default:
      return {"#5b1a4b", "#ffffff"};
  }
}

// names of cases have underscores, which the terminal would take for subscripts
std::string plain(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '_' || c == '^' || c == '@' || c == '{' || c == '}' || c == '&') out += '\\';
    out += c;
  }
  return out;
}

// those from this number on stand outside of the plot
constexpr int kOutside = 100000;
std::string rectangle(int number, double left, double top, double width, double height, const char* fill) {
  return "set object " + std::to_string(number) + " rectangle from " + fixed(left, 3) + "," + fixed(top, 3) +
         " to " + fixed(left + width, 3) + "," + fixed(top + height, 3) + " fillcolor rgb '" + fill +
         "' fillstyle solid 1 border lc rgb '#ffffff'" + (number >= kOutside ? " noclip" : "") + "\n";
}

std::string label(const std::string& text, double x, double y, const std::string& place, const char* color,
                  const std::string& font) {
  return "set label " + quoted(text) + " at " + fixed(x, 3) + "," + fixed(y, 3) + " " + place +
         " font 'DejaVu Sans" + font + "' textcolor rgb '" + color + "' front\n";
}

}  // namespace

StabilityPicture overviewPicture(const std::vector<CaseRow>& rows) {
  const auto names = caseNames(rows);
  std::vector<AxialModel> models;
  for (const CaseRow& row : rows)
    if (std::find(models.begin(), models.end(), row.model) == models.end()) models.push_back(row.model);

  // one unit per cell; the first column of text to the left of x = 0
  std::string script;
  int number = 0;
  const double rows_n = static_cast<double>(names.size()), columns = static_cast<double>(models.size());
  for (std::size_t y = 0; y < names.size(); ++y) {
    const auto top = static_cast<double>(y);
    std::string limit, quantity;
    for (std::size_t x = 0; x < models.size(); ++x) {
      const CaseRow* row = rowOf(rows, names[y], models[x]);
      const Look look = lookOf(row);
      script += rectangle(++number, static_cast<double>(x), top, 1, 1, look.fill);
      if (row == nullptr || !row->applicable) continue;
      // a row may have a second condition, which its note tells
      const bool other = !row->passed && row->measured && row->limit && *row->measured <= *row->limit;
      script += label(plain(shortNumber(row->measured)) + (other ? " *" : ""), static_cast<double>(x) + 0.5,
                      top + 0.5, "center", look.text, ",11");
      if (quantity.empty()) quantity = row->quantity, limit = shortNumber(row->limit);
    }
    script += label(plain(names[y]), -0.12, top + 0.3, "right", "#1c2329", ",11");
    script += label(plain(quantity + " ≤ " + limit), -0.12, top + 0.72, "right", "#7d8790", ",9");
  }
  for (std::size_t x = 0; x < models.size(); ++x)
    script += label(std::string(shortName(models[x])), static_cast<double>(x) + 0.5, -0.4, "center",
                    "#1c2329", models[x] == AxialModel::kEnhancedTrackingWall ? " Bold,11" : ",11");

  // the key below: three verdicts and what was not asked
  const std::array<std::pair<const char*, const char*>, 4> key = {
      {{"#cfe2f3", "stable"},
       {"#f6b26b", "over the limit (*: its other condition), bounded"},
       {"#5b1a4b", "grows, or only the gate holds it"},
       {"#f3f4f5", "says nothing about this model"}}};
  const double widths[] = {0.0, 1.1, 5.0, 7.9};
  for (std::size_t i = 0; i < key.size(); ++i) {
    const double left = (widths[i] - 1.2) * std::max(1.0, columns / 9);
    script += rectangle(kOutside + static_cast<int>(i), left, rows_n + 0.35, 0.22, 0.4, key[i].first);
    script += label(key[i].second, left + 0.3, rows_n + 0.55, "left", "#4a5560", ",10");
  }
  const int width = 500 + 96 * static_cast<int>(models.size()),
            height = 130 + 40 * static_cast<int>(names.size());
  script = "unset border\nunset tics\nunset key\nset lmargin at screen " + fixed(420.0 / width, 4) +
           "\nset rmargin at screen " + fixed(1 - 20.0 / width, 4) + "\nset tmargin at screen " +
           fixed(1 - 78.0 / height, 4) + "\nset bmargin at screen " + fixed(52.0 / height, 4) +
           "\nset xrange [0:" + fixed(columns, 0) + "]\nset yrange [" + fixed(rows_n, 0) + ":0]\n" +
           "set label 9999 " + quoted(plain(findingOf(rows))) + " at screen 0.5, screen " +
           fixed(1 - 24.0 / height, 4) + " center font 'DejaVu Sans Bold,12' textcolor rgb '#1c2329'\n" +
           script + "plot NaN notitle\n";
  return {script, width, height};
}

namespace {

struct HoldRow {
  const char* case_name;
  const char* title;
};
constexpr HoldRow kHolds[] = {
    {"hold_quantised", "Encoder of 30 µm, still hand"},
    {"hold_tremor_random", "Tremor, the worst of the hands"},
    {"boundary_hold", "Tip where 2 N begin after 1 N"},
};
constexpr AxialModel kHeld[] = {AxialModel::kEnhancedTrackingWall, AxialModel::kVoigt, AxialModel::kDirect};
constexpr double kShown_s = 0.4;

const CaseTrace* holdTrace(const std::vector<CaseOutcome>& outcomes, const char* case_name,
                           AxialModel model) {
  for (const CaseOutcome& one : outcomes)
    if (one.row.case_name == case_name && one.row.model == model && !one.traces.empty())
      return &one.traces.front();
  return nullptr;
}

}  // namespace

Result<StabilityPicture> holdsPicture(const std::vector<CaseOutcome>& outcomes,
                                      const std::filesystem::path& csv) {
  // each curve about its own mean, from one second into its window: long enough after the begin of the hold
  FigureTable table("panel,t_s,force_n");
  struct Panel {
    std::size_t row, column;
    double mean = 0, swing = 0;
    std::string verdict;
  };
  std::vector<Panel> panels;
  for (std::size_t r = 0; r < std::size(kHolds); ++r)
    for (std::size_t c = 0; c < std::size(kHeld); ++c) {
      const CaseTrace* trace = holdTrace(outcomes, kHolds[r].case_name, kHeld[c]);
      if (trace == nullptr) continue;
      const double from = trace->from_s + 1, to = from + kShown_s;
      std::vector<std::pair<double, double>> shown;
      for (std::size_t i = 0; i < trace->time_s.size(); ++i)
        if (trace->time_s[i] >= from && trace->time_s[i] < to)
          shown.emplace_back(trace->time_s[i] - from, trace->force_N[i]);
      if (shown.empty()) continue;
      Panel panel{r, c, 0, 0, {}};
      for (const auto& point : shown) panel.mean += point.second / static_cast<double>(shown.size());
      for (const auto& [t, force] : shown) {
        panel.swing = std::max(panel.swing, std::abs(force - panel.mean));
        table.row({static_cast<double>(r * 10 + c), t, force - panel.mean});
      }
      for (const CaseOutcome& one : outcomes)
        if (one.row.case_name == kHolds[r].case_name && one.row.model == kHeld[c])
          panel.verdict = verdictText(one.row.verdict);
      panels.push_back(panel);
    }
  if (panels.empty()) return StabilityPicture{};
  const std::string text = table.take();
  if (const Status status = writeFileAtomically(csv, viewOf(text)); !status.ok()) return status.error();

  std::string script = figureStyle() + R"(unset key
set multiplot
set label 100 'Held still, the wall gives the hand a still force; a damper or a force step does not' at screen 0.5, 0.965 center font 'DejaVu Sans Bold,15' textcolor rgb '#1c2329'
set label 101 'force less its mean [N]' at screen 0.018, 0.48 center rotate by 90 textcolor rgb '#2b333b'
set label 102 'time in the hold [s]' at screen 0.53, 0.03 center textcolor rgb '#2b333b'
set yrange [-0.7:1.15]
set ytics -0.5, 0.5, 1
set xrange [0:)" + fixed(kShown_s, 1) +
                       R"(]
set xtics 0.1
set grid
)";
  for (const Panel& panel : panels) {
    const double left = 0.08 + 0.31 * static_cast<double>(panel.column);
    const double top = 0.86 - 0.275 * static_cast<double>(panel.row);
    const bool still = panel.verdict == verdictText(Verdict::kStable);
    const bool last = panel.row + 1 == std::size(kHolds), first = panel.column == 0;
    script += "set lmargin at screen " + fixed(left, 3) + "\nset rmargin at screen " +
              fixed(left + 0.285, 3) + "\nset tmargin at screen " + fixed(top, 3) +
              "\nset bmargin at screen " + fixed(top - 0.2, 3) + "\nset format x '" + (last ? "%g" : "") +
              "'\nset format y '" + (first ? "%g" : "") + "'\n";
    script += "set label 1 " + quoted(first ? kHolds[panel.row].title : "") + " at screen " + fixed(left, 3) +
              ", screen " + fixed(top + 0.022, 3) + " left font 'DejaVu Sans,12' textcolor rgb '#4a5560'\n";
    script += "set label 2 " +
              quoted(std::string(shortName(kHeld[panel.column])) + ": " + panel.verdict + ", ± " +
                     shortNumber(panel.swing) + " N about " + shortNumber(panel.mean) + " N") +
              " at graph 0.98, graph 0.1 right font 'DejaVu Sans,11' textcolor rgb '" +
              (still ? "#1f5fa8" : "#8a4306") + "'\n";
    script += "plot " + quoted(csv.string()) +
              " using ($1 == " + std::to_string(panel.row * 10 + panel.column) +
              " ? $2 : 1/0):3 skip 1 with lines lw 1.6 lc rgb '" + (still ? "#1f5fa8" : "#e07b1f") + "'\n" +
              "unset label 100\nunset label 101\nunset label 102\n";
  }
  return StabilityPicture{script + "unset multiplot\n", 1300, 900};
}

Status drawStability(const std::vector<CaseOutcome>& outcomes, const std::filesystem::path& out) {
  std::vector<CaseRow> rows;
  for (const CaseOutcome& one : outcomes) rows.push_back(one.row);
  const auto holds = holdsPicture(outcomes, out / "stability-holds.csv");
  if (!holds.ok()) return holds.error();
  if (!hasGnuplot()) {
    std::fprintf(stderr,
                 "needlelab-sim stability: gnuplot is not on the PATH: no pictures (Debian: gnuplot-nox)\n");
    return {};
  }
  const StabilityPicture overview = overviewPicture(rows);
  const auto draw = [&](const StabilityPicture& picture, const char* name) -> Status {
    if (picture.script.empty()) return {};
    const auto png = out / name;
    return plotPng(picture.script, png, picture.width_px, picture.height_px);
  };
  if (const Status status = draw(overview, "stability.png"); !status.ok()) return status;
  return draw(*holds, "stability-holds.png");
}

}  // namespace needlelab
