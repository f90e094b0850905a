#include "client/sim/skill_picture.h"

#include <algorithm>
#include <cmath>
#include <system_error>

#include "client/sim/tools/figure_table.h"
#include "client/sim/tools/gnuplot.h"

namespace needlelab {
namespace {

// names of measures have underscores, which the terminal would take for subscripts
std::string withoutMarkup(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '_' ? std::string("\\_") : std::string(1, c);
  return out;
}

}  // namespace

Status drawSkill(const SkillReport& report, const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return Error{ErrorCode::kFailed, "cannot make " + folder.string() + ": " + error.message()};

  // the axis holds the estimates; intervals of near-constant measures may run out of it
  double most = 1;
  for (const SkillRow& row : report.rows) {
    if (std::isfinite(row.hedges_g)) most = std::max(most, std::abs(row.hedges_g));
  }
  most = std::ceil(1.25 * most);
  std::string data[2], tics;
  const auto n = report.rows.size();
  for (std::size_t i = 0; i < n; ++i) {
    const SkillRow& row = report.rows[i];
    const auto held = [&](double v) {
      return fixed(std::clamp(std::isfinite(v) ? v : 10 * most, -most, most), 4);
    };
    const std::string y = std::to_string(n - i);
    data[row.separates ? 0 : 1] +=
        held(row.hedges_g) + " " + y + " " + held(row.g_95.low) + " " + held(row.g_95.high) + "\n";
    tics += (tics.empty() ? "" : ", ") + quoted(withoutMarkup(row.measure)) + " " + y;
  }
  std::string script = "$apart << EOD\n" + data[0] + "EOD\n$not << EOD\n" + data[1] + "EOD\n";
  // finding and caution in three lines; the finding parts at its semicolon
  std::string title = findingOf(report);
  if (const std::size_t at = title.find("; "); at != std::string::npos) title.replace(at, 2, ";\\n");
  script += "set title \"" + title +
            "\\n{/DejaVuSans=10 Simulated hands: a check of the machinery, no evidence about people}\" font "
            "'DejaVu "
            "Sans Bold,12'\n";
  script +=
      "set xlabel \"Hedges' g, experts against novices (dimensionless), 95 % bootstrap interval (cut at "
      "the edge)\" font "
      "'DejaVu Sans,11' offset 0,0.5\nset xtics font 'DejaVu Sans,10'\n";
  script += "set xrange [" + fixed(-most, 0) + ":" + fixed(most, 0) +
            "]\nset yrange [0:" + std::to_string(n + 1) + "]\nset ytics (" + tics +
            ") font 'DejaVu Sans,9'\nset grid x lc rgb '#dde1e4'\n" +
            "set arrow 1 from 0, graph 0 to 0, graph 1 nohead lc rgb '#7d8790'\n" +
            "set key below center horizontal font 'DejaVu Sans,10'\nset bmargin 5\n";
  std::string plots;
  const auto add = [&](const std::string& text) { plots += (plots.empty() ? "plot " : ", ") + text; };
  if (!data[0].empty())
    add("$apart using 1:2:3:4 with xerrorbars pt 7 ps 1.1 lw 1.6 lc rgb '#0b5fa5' title 'separates "
        "(permutation p ≤ 0.05)'");
  if (!data[1].empty())
    add("$not using 1:2:3:4 with xerrorbars pt 6 ps 1.1 lw 1.2 lc rgb '#d9822b' title 'does not separate'");
  if (plots.empty()) return Error{ErrorCode::kFailed, "no measure differs between trainees: nothing to draw"};
  return plotPng(script + plots + "\n", folder / "skill.png", 1000, 240 + 22 * static_cast<int>(n));
}

}  // namespace needlelab
