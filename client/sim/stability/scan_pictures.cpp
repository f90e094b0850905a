/// The pictures of the study of stiffness, for gnuplot.
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <set>

#include "client/sim/stability/scan_report.h"
#include "client/sim/tools/figure_table.h"

namespace needlelab {
namespace {

// colours of Okabe and Ito (2008), told apart by the colour-blind; marks differ too. In the order of
// kAxialModelNames
struct Mark {
  const char* colour;
  int point;
};
constexpr std::array<Mark, kAxialModelCount> kMarks = {{{"#0072B2", 7},
                                                        {"#56B4E9", 6},
                                                        {"#D55E00", 9},
                                                        {"#CC79A7", 5},
                                                        {"#E69F00", 11},
                                                        {"#009E73", 13},
                                                        {"#000000", 2},
                                                        {"#7A5195", 8},
                                                        {"#8C564B", 4}}};
constexpr double kCap_N_per_m = 10'000;  // of a profile

std::string markOf(AxialModel model, double size) {
  const Mark& mark = kMarks[static_cast<std::size_t>(model)];
  return "pt " + std::to_string(mark.point) + " ps " + fixed(size, 2) + " lw 1.8 lc rgb '" + mark.colour +
         "'";
}

// a name as people read it: "Enhanced tracking wall"
std::string spoken(AxialModel model) {
  std::string name(axialModelName(model));
  for (std::size_t i = 1; i < name.size(); ++i)
    name[i] = name[i] == '_' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(name[i])));
  return model == AxialModel::kFem ? "FEM" : name;
}

std::string title(const std::string& words, const std::string& below) {
  return "set label 100 " + quoted(words) +
         " at screen 0.5, 0.975 center font 'DejaVu Sans Bold,17' textcolor rgb '#1c2329'\n" +
         "set label 101 " + quoted(below) +
         " at screen 0.5, 0.945 center font 'DejaVu Sans,12' textcolor rgb '#4a5560'\n";
}

std::string margins(double left, double right, double bottom, double top) {
  return "set lmargin at screen " + fixed(left, 3) + "\nset rmargin at screen " + fixed(right, 3) +
         "\nset bmargin at screen " + fixed(bottom, 3) + "\nset tmargin at screen " + fixed(top, 3) + "\n";
}

std::set<AxialModel> modelsOf(const StiffnessLimits& limits) {
  std::set<AxialModel> models;
  for (const StiffnessLimitRow& row : limits.rows) models.insert(row.model);
  return models;
}

}  // namespace

std::string limitsScript(const StiffnessLimits& limits, const std::filesystem::path& csv) {
  if (limits.rows.empty()) return figureStyle() + "plot 0\n";
  std::set<unsigned> delays;
  double lowest_hz = limits.rows.front().rate_hz, highest_hz = lowest_hz;
  for (const StiffnessLimitRow& row : limits.rows) {
    delays.insert(row.delay_ticks);
    lowest_hz = std::min(lowest_hz, row.rate_hz);
    highest_hz = std::max(highest_hz, row.rate_hz);
  }
  const auto models = modelsOf(limits);
  // b + b_hand, from any row
  const StiffnessLimitRow& any = limits.rows.front();
  const double damping = any.passive_N_per_m * (0.5 + any.delay_ticks) / any.rate_hz;
  const std::string file = quoted(csv.string());

  // a line must not be broken by the rows between: the exact loop with Voigt's damper as blocks of its own
  std::string script = figureStyle();
  for (const unsigned delay : delays) {
    script += "$voigt" + std::to_string(delay) + " << EOD\n";
    for (const StiffnessLimitRow& row : limits.rows)
      if (row.model == AxialModel::kVoigt && row.delay_ticks == delay)
        script += fixed(row.rate_hz, 1) + "," + fixed(row.sampled_N_per_m, 1) + "\n";
    script += "EOD\n";
  }
  script +=
      "set multiplot\nset logscale xy\nset xrange [" + fixed(lowest_hz * 0.78, 1) + ":" +
      fixed(highest_hz * 1.3, 1) +
      "]\nset yrange [150:30000]\n"
      "set xtics ('250' 250, '500' 500, '1000' 1000, '2000' 2000, '4000' 4000, '10,000' 10000)\n"
      "set ytics ('200' 200, '500' 500, '1000' 1000, '2000' 2000, '5000' 5000, '10,000' 10000)\n"
      "unset key\n" +
      title("How stiff a wall can be is decided by rate, delay and damping, not by the model",
            "largest stiffness K at which a nudge dies out (closed loop, bisection to 2 %); handle 0.35 kg, "
            "b + b_{hand} = " +
                fixed(damping, 1) + " N·s/m, encoder 10 µm");
  std::size_t i = 0;
  for (const unsigned delay : delays) {
    const bool left = i % 2 == 0, top = i < 2;
    script += margins(left ? 0.085 : 0.57, left ? 0.505 : 0.985, top ? 0.575 : 0.17, top ? 0.915 : 0.51);
    script += "set ylabel " + quoted(left ? "largest stable stiffness K [N/m]" : "") + "\nset xlabel " +
              quoted(top ? "" : "rate of the haptic loop 1/T [Hz]") + "\n";
    const std::string late = std::to_string(delay) + (delay == 1 ? " tick" : " ticks");
    script += "set label 1 " + quoted("delay d = " + late) +
              " at graph 0.03, 0.94 left font 'DejaVu Sans Bold,13' textcolor rgb '#1c2329'\n";
    script += "set label 2 'largest K of a profile: stable there too' at graph 0.03, first " +
              fixed(kCap_N_per_m * 1.16, 0) + " left font 'DejaVu Sans,10' textcolor rgb '#7d8790'\n";
    script += "set arrow 1 from graph 0, first " + fixed(kCap_N_per_m, 0) + " to graph 1, first " +
              fixed(kCap_N_per_m, 0) + " nohead ls 6\n";
    script +=
        "set label 3 'line: K = (b + b_{hand}) / (T (½ + d))' at graph 0.97, 0.14 right font 'DejaVu "
        "Sans,12' textcolor rgb '#2b333b'\n";
    if (models.count(AxialModel::kVoigt) != 0)
      script +=
          "set label 4 'dashed: the exact loop with Voigt’s own damper' at graph 0.97, 0.07 right font "
          "'DejaVu Sans,12' textcolor rgb '#A8437F'\n";
    // the lines first, then the marks, side by side
    script += "plot " + fixed(damping, 6) + "*x/(0.5+" + std::to_string(delay) +
              ") with lines lc rgb '#2b333b' lw 2.2 notitle";
    if (models.count(AxialModel::kVoigt) != 0)
      script +=
          ", $voigt" + std::to_string(delay) + " using 1:2 with lines lc rgb '#CC79A7' lw 2 dt (8,5) notitle";
    for (const AxialModel model : models) {
      const int place = static_cast<int>(model);
      const std::string at = "($1==" + std::to_string(place) + " && $3==" + std::to_string(delay) + " ? $2*" +
                             fixed(std::pow(1.032, place - 4), 5) + " : 1/0):4";
      script += ", " + file + " using " + at + " skip 1 with points " + markOf(model, 1.35) + " notitle";
    }
    script += "\nunset label 100\nunset label 101\n";
    ++i;
  }

  // the key, below all
  script +=
      "unset label\nunset arrow\nunset logscale\nunset border\nunset tics\nunset xlabel\nunset ylabel\n" +
      margins(0.02, 0.98, 0.005, 0.1) +
      "set xrange [0:1]\nset yrange [0:1]\nset key at graph 0.5, 0.95 center top horizontal Left reverse "
      "maxcols 5 width 2 nobox samplen 1.2\nplot NaN notitle";
  for (const AxialModel model : models)
    script += ", NaN with points " + markOf(model, 1.35) + " title " + quoted(spoken(model));
  return script + "\nunset multiplot\n";
}

std::string restScript(const StiffnessLimits& limits, const std::filesystem::path& csv) {
  if (limits.rest.empty()) return figureStyle() + "plot 0\n";
  std::set<double> steps;
  double least = 1e9, most = 0;  // measured over theory
  for (const RestLimitRow& row : limits.rest) {
    steps.insert(row.encoder_step_m);
    if (row.at_cap || row.theory_N_per_m <= 0) continue;
    least = std::min(least, row.stiffness_N_per_m / row.theory_N_per_m);
    most = std::max(most, row.stiffness_N_per_m / row.theory_N_per_m);
  }
  const std::array<Mark, 3> marks = {kMarks[0], kMarks[2], kMarks[5]};
  const std::string file = quoted(csv.string());
  std::string script =
      figureStyle() + "set logscale xy\nset xrange [0.002:0.45]\nset yrange [40:16000]\nset samples 2000\n" +
      margins(0.115, 0.97, 0.1, 0.9) +
      title("A coarse encoder needs dry friction, or the wall never comes to rest",
            "1 kHz, no delay; theory K ≤ min(2b/T, 2f_c/Δ) is on the safe side: measured " + fixed(least, 1) +
                " to " + fixed(most, 1) + " times as much") +
      "set xlabel 'dry friction of the device f_c [N]'\nset ylabel 'largest K at which the needle stands "
      "still "
      "after a nudge [N/m]'\nset xtics (0.003, 0.01, 0.03, 0.1, 0.3)\nset ytics ('50' 50, '100' 100, '200' "
      "200, '500' 500, '1000' 1000, '2000' 2000, '5000' 5000, '10,000' 10000)\nset key bottom right Left "
      "reverse\nset arrow 1 from graph 0, first 10000 to graph 1, first 10000 nohead ls 6\nset label 2 "
      "'largest "
      "K of a profile: stands still there too' at graph 0.02, first 11600 left font 'DejaVu Sans,10' "
      "textcolor "
      "rgb '#7d8790'\nleast(a, b) = a < b ? a : b\nplot ";
  std::size_t i = 0;
  for (const double step : steps) {
    const Mark& mark = marks[i % marks.size()];
    const std::string here = "(abs($1/" + fixed(step * 1e6, 3) + "e-6-1)<1e-3 ? $2 : 1/0)";
    const std::string micro = fixed(step * 1e6, 0) + " µm";
    if (i > 0) script += ", ";
    script += "least(" + fixed(limits.rest.front().bound_N_per_m, 1) + ", 2*x/" + fixed(step * 1e6, 3) +
              "e-6) with lines lw 2 lc rgb '" + mark.colour + "' title 'theory, encoder step Δ = " + micro +
              "', " + file + " using " + here + ":3 skip 1 with points ps 1.7 lw 2 pt " +
              std::to_string(mark.point) + " lc rgb '" + mark.colour + "' title 'measured, " + micro + "'";
    ++i;
  }
  return script + "\n";
}

std::string beyondScript(const StiffnessLimits& limits, const std::filesystem::path& csv) {
  if (limits.beyond.empty()) return figureStyle() + "plot 0\n";
  const std::string file = quoted(csv.string());
  const BeyondRow& first = limits.beyond.front();
  std::string script =
      figureStyle() + "set multiplot\nunset key\nset xrange [-0.1:1.5]\n" +
      title("Half as stiff again as is stable: the swing grows to all the force that a model can give",
            "force after a nudge at 1.5 × each model's own limit, " + fixed(first.rate_hz, 0) + " Hz, " +
                std::to_string(first.delay_ticks) +
                " tick late, tissue of 1 N on the way in and 0.5 N on the "
                "way out; dashed: these forces");
  constexpr std::size_t kColumns = 3;
  const std::size_t lines = (limits.beyond.size() + kColumns - 1) / kColumns;
  const double width = 0.945 / kColumns, height = 0.86 / static_cast<double>(lines);
  for (std::size_t i = 0; i < limits.beyond.size(); ++i) {
    const BeyondRow& row = limits.beyond[i];
    const std::size_t column = i % kColumns, line = i / kColumns;
    const double left = 0.05 + width * static_cast<double>(column);
    const double top = 0.925 - height * static_cast<double>(line);
    const bool lowest = i + kColumns >= limits.beyond.size();
    script += margins(left + 0.012, left + width - 0.012, top - height + 0.045, top - 0.03);
    script += "set yrange [-1.2:" + std::string(row.max_force_N > 1.6 ? "4" : "2") + "]\nset ytics 1\n" +
              "set ylabel " + quoted(column == 0 ? "resistance [N]" : "") + " offset 1,0\nset xlabel " +
              quoted(lowest ? "time after the nudge [s]" : "") + "\n";
    script +=
        "set label 1 " +
        quoted(spoken(row.model) + ", " + fixed(row.stiffness_N_per_m, 0) + " N/m: " +
               (row.swing_N > 0 ? fixed(row.swing_N, 1) + " N peak-to-peak" : "let the needle through")) +
        " at graph 0.5, 1.06 center font 'DejaVu Sans,11' textcolor rgb '#1c2329'\n";
    script +=
        "set arrow 1 from graph 0, first 1 to graph 1, first 1 nohead ls 6 front\n"
        "set arrow 2 from graph 0, first -0.5 to graph 1, first -0.5 nohead ls 6 front\n";
    script += "plot " + file + " using ($1==" + std::to_string(static_cast<int>(row.model)) +
              " ? $2 : 1/0):3 skip 1 with lines lw 1.2 lc rgb '" +
              kMarks[static_cast<std::size_t>(row.model)].colour + "'\nunset label 100\nunset label 101\n";
  }
  return script + "unset multiplot\n";
}

}  // namespace needlelab
