/// Fig. 8 and 9: six layers of 1, 2, 1.5, 2.5, 3 and 4 N, 0.4 N on the way out, in three degrees of freedom.
#include <algorithm>
#include <cmath>

#include "client/sim/tools/figure_table.h"

namespace needlelab {
namespace {

constexpr double kFilmRate_hz = 1000;
constexpr double kFrom_s = -0.25, kTo_s = 1.75;  // the time axis
constexpr double kLeadIn_s = 0.8;  // rest before the figure's time 0; the gate's fade-in is over by then

// the skin somewhere in the device's workspace, inclined to all three axes
Pose obliqueSkin() {
  return {{0.45, 0.08, 0.12}, orientationAlong({0.45, -0.35, 0.82})};
}

// a firm grip, as for a quick push into hard tissue
SimulatedDeviceOptions firmGrip() {
  SimulatedDeviceOptions device;
  device.hand.stiffness_N_per_m = 900;
  device.hand.damping_Ns_per_m = 15;
  return device;
}

// in from 0 s to 0.75 s, out to 1.5 s, as in the paper
HandPlan sixLayerPlan() {
  const Pose X_WL = obliqueSkin();
  const Vec3 in = -zAxis(X_WL.q);
  const Quat q = orientationAlong(in);
  const auto at = [&](double depth_m) { return Pose{X_WL.p + in * depth_m, q}; };
  // the hand aims beyond where the tip gets to: at 4 N its spring gives way by 4.4 mm
  HandPlan plan(at(-0.015));
  plan.hold(kLeadIn_s - 0.24)
      .moveIn(at(0.056), 0.97, Motion::kTrapezoid)
      .moveIn(at(-0.03), 1.03, Motion::kTrapezoid)
      .hold(0.1);
  return plan;
}

}  // namespace

Result<FigureRun> runSixLayers() {
  const auto model = paperScene("paper-six-layers", obliqueSkin(), kFilmRate_hz);
  if (!model.ok()) return model.error();
  return runPlan(*model, firmGrip(), sixLayerPlan(), -kLeadIn_s);
}

Figure figure08(const FigureRun& run, const std::filesystem::path& csv_path) {
  Figure figure{"fig08", "Tracking wall, 3 DoF: positions", {}, {}, 1200, 1000};
  FigureTable table("t_s,px_m,py_m,pz_m,wx_m,wy_m,wz_m,depth_m,layer,phase");
  double low[3] = {1e9, 1e9, 1e9}, high[3] = {-1e9, -1e9, -1e9};
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const Vec3 p = run.ticks[i].X_WT.p;
    const StepReport& report = run.ticks[i].report;
    const Vec3 w = report.p_wall_W_m;
    table.row(
        {run.time_s(i), p.x, p.y, p.z, w.x, w.y, w.z, report.depth_m, static_cast<double>(report.layer)},
        {phaseName(report.phase)});
    const double axes[3] = {p.x, p.y, p.z};
    for (int a = 0; a < 3; ++a) low[a] = std::min(low[a], axes[a]), high[a] = std::max(high[a], axes[a]);
  }
  figure.csv = table.take();

  const auto spans = phaseSpans(run, 0.02);
  const std::string file = quoted(csv_path.string());
  std::string script = figureStyle() + phaseShades(spans, 1) + R"(set multiplot
set xrange [-0.25:1.75]
set xtics 0.25
set lmargin at screen 0.085
set rmargin at screen 0.97
set format x ''
set label 100 'Enhanced tracking wall in 3 DoF: needle tip and wall along each axis of the device' at screen 0.5, 0.975 center font 'DejaVu Sans Bold,16' textcolor rgb '#1c2329'
)" + phaseNames(spans, kFrom_s, kTo_s);
  const char* axis[3] = {"x", "y", "z"};
  for (int a = 0; a < 3; ++a) {
    const double top = 0.91 - 0.285 * a, bottom = top - 0.255;
    const double margin = 0.12 * (high[a] - low[a]);
    script += "set tmargin at screen " + fixed(top, 3) + "\nset bmargin at screen " + fixed(bottom, 3) +
              "\nset ylabel '" + axis[a] + " [mm]'\nset yrange [" + fixed((low[a] - margin) * 1000, 1) + ":" +
              fixed((high[a] + margin) * 1000, 1) + "]\nset ytics 10\n";
    if (a == 2) script += "set format x '%g'\nset xlabel 'time [s]'\n";
    script += a == 0 ? "set key bottom right\n" : "unset key\n";
    script += "plot " + file + " using 1:($" + std::to_string(2 + a) +
              "*1000) skip 1 with lines ls 1 title 'needle tip', '' using 1:($" + std::to_string(5 + a) +
              "*1000) skip 1 with lines ls 2 title 'wall ω_n'\n";
    if (a == 0) script += "unset label\n";
  }
  figure.script = script + "unset multiplot\n";
  return figure;
}

Figure figure09(const FigureRun& run, const std::filesystem::path& csv_path) {
  Figure figure{"fig09", "Cutting and attracted forces, 3 DoF", {}, {}, 1200, 720};
  FigureTable table("t_s,cutting_force_n,attracted_force_n,axial_force_n,fx_n,fy_n,fz_n,depth_m,layer,phase");
  // when each layer is reached for the first time, for the marks
  std::vector<double> starts_s;
  double turn_s = 0;
  std::int32_t deepest = -1;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const StepReport& report = run.ticks[i].report;
    const Vec3 f = report.wrench_W.force_N;
    // the paper's signs: cutting up, attracted down
    table.row(
        {run.time_s(i), -report.cutting_N, -report.attracted_N, -(report.cutting_N + report.attracted_N), f.x,
         f.y, f.z, report.depth_m, static_cast<double>(report.layer)},
        {phaseName(report.phase)});
    if (report.layer > deepest) {
      deepest = report.layer;
      starts_s.push_back(run.time_s(i));
    }
    if (turn_s == 0 && report.phase == Phase::kWithdrawing) turn_s = run.time_s(i);
  }
  figure.csv = table.take();

  std::string marks;
  for (std::size_t i = 0; i < starts_s.size(); ++i) {
    const std::string t = fixed(starts_s[i], 4);
    const double middle = (starts_s[i] + (i + 1 < starts_s.size() ? starts_s[i + 1] : turn_s)) / 2;
    marks += "set arrow from " + t + ",-0.9 to " + t + ",4.6 nohead ls 6\nset label '" +
             std::to_string(i + 1) + "' at " + fixed(middle, 4) +
             ",-0.7 center font 'DejaVu Sans Bold,11' textcolor rgb '#4a5560'\n";
  }
  if (!starts_s.empty())
    marks += "set label 'layer' at " + fixed(starts_s.front(), 4) +
             ",-0.7 right offset -0.6,0 font 'DejaVu Sans,11' textcolor rgb '#4a5560'\n";

  const auto spans = phaseSpans(run, 0.02);
  const std::string file = quoted(csv_path.string());
  figure.script = figureStyle() + phaseShades(spans, 1) + R"(set xrange [-0.25:1.75]
set xtics 0.25
set yrange [-0.9:4.6]
set ytics 0.5
set lmargin at screen 0.075
set rmargin at screen 0.97
set tmargin at screen 0.88
set bmargin at screen 0.105
set xlabel 'time [s]'
set ylabel 'force [N]'
set label 100 'Cutting and attracted force through six layers: 1, 2, 1.5, 2.5, 3, 4 N in, 0.4 N out' at screen 0.5, 0.965 center font 'DejaVu Sans Bold,16' textcolor rgb '#1c2329'
set arrow from -0.25,-0.4 to 1.75,-0.4 nohead ls 6
set arrow from -0.25,0 to 1.75,0 nohead ls 6
set key top right
)" + phaseNames(spans, kFrom_s, kTo_s) +
                  marks + "plot " + file +
                  R"( using 1:4 skip 1 with lines lc rgb '#4a5560' lw 2 title 'no force', \
     '' using 1:($2 > 0 ? $4 : 1/0) skip 1 with lines ls 3 title 'cutting force', \
     '' using 1:($3 < 0 ? $4 : 1/0) skip 1 with lines ls 4 title 'attracted force'
)";
  return figure;
}

}  // namespace needlelab
