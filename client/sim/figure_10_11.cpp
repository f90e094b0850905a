/// Fig. 10 and 11: the virtual fixture. In with a drift aside, drawn back in part, trajectory changed, in to
/// the target, out.
#include <algorithm>
#include <cmath>
#include <optional>

#include "client/sim/tools/figure_table.h"

namespace needlelab {
namespace {

constexpr double kClampingRate_hz = 1000;
constexpr Vec3 kTarget_W_m{0.008, 0, -0.036};  // the profile's target
constexpr Vec3 kBeyond{0.005, 0, 0};           // the hand aims beyond the target: its spring gives way
constexpr double kArrow_mm_per_N = 6;

HandPlan clampingPlan() {
  const Vec3 first = normalized(Vec3{-0.22, 0.10, -1});          // the way that the user begins with
  const Vec3 aside = normalized(cross(first, Vec3{0.3, 1, 0}));  // where he drifts to
  const Vec3 right = normalized(kTarget_W_m);                    // the way to the target
  const Quat q1 = orientationAlong(first), q2 = orientationAlong(right);
  const auto on = [](Vec3 axis, double length_m) { return axis * length_m; };
  HandPlan plan({on(first, -0.02), q1});
  plan.hold(0.5)
      .moveTo({on(first, -0.006), q1}, 0.02, Motion::kMinJerk)                 // to the skin
      .moveTo({on(first, 0.016) + aside * 0.001, q1}, 0.012, Motion::kLinear)  // in, almost on the trajectory
      .moveTo({on(first, 0.036) + aside * 0.0075, q1}, 0.012, Motion::kLinear)  // departs from it: point 1
      .hold(0.6)
      .moveTo({on(first, 0.015) + aside * 0.002, q1}, 0.018, Motion::kTrapezoid)  // back, but not out
      .moveTo({on(right, 0.015) + kBeyond, q2}, 0.012, Motion::kMinJerk)          // another direction
      .moveTo({kTarget_W_m + kBeyond, q2}, 0.012, Motion::kLinear)                // in to the target: point 2
      .hold(0.8)
      .moveTo({on(right, -0.02), q2}, 0.025, Motion::kTrapezoid)
      .hold(0.3);
  return plan;
}

// what a reader wants to see named
struct Places {
  std::optional<std::size_t> entry, first_turn;  // ticks
  std::size_t point1 = 0, point2 = 0;
};

Places placesOf(const FigureRun& run) {
  Places places;
  double deepest1 = 0, nearest = 1e9;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const StepReport& report = run.ticks[i].report;
    if (!places.entry && (report.flags & kFlagEntry) != 0) places.entry = i;
    if (!places.first_turn && (report.flags & kFlagTurn) != 0) places.first_turn = i;
    // point 1: the deepest before the trajectory turned
    if (!places.first_turn && report.insertion_m > deepest1) deepest1 = report.insertion_m, places.point1 = i;
    if (const double away = norm(run.ticks[i].X_WT.p - kTarget_W_m); away < nearest)
      nearest = away, places.point2 = i;
  }
  return places;
}

std::string inMillimetres(Vec3 p_m) {
  return fixed(p_m.x * 1000, 3) + "," + fixed(p_m.y * 1000, 3) + "," + fixed(p_m.z * 1000, 3);
}

std::string pointLabel(Vec3 p_m, const std::string& text, const std::string& offset) {
  return "set label '" + text + "' at " + inMillimetres(p_m) + " point pt 7 ps 1.3 lc rgb '#1c2329' offset " +
         offset + " font 'DejaVu Sans Bold,12' textcolor rgb '#1c2329' front\n";
}

std::string line3(Vec3 from_m, Vec3 to_m, const std::string& style) {
  return "set arrow from " + inMillimetres(from_m) + " to " + inMillimetres(to_m) + " " + style + "\n";
}

}  // namespace

Result<FigureRun> runClamping() {
  const auto model = paperScene("paper-clamping", {}, kClampingRate_hz);
  if (!model.ok()) return model.error();
  return runPlan(*model, {}, clampingPlan(), 0);
}

Figure figure10(const FigureRun& run, const std::filesystem::path& csv_path) {
  Figure figure{"fig10", "Virtual fixture: path and clamping forces", {}, {}, 1200, 1000};
  FigureTable table("t_s,px_m,py_m,pz_m,fx_n,fy_n,fz_n,clamping_n,lateral_error_m,insertion_m,arrow,phase");
  // an arrow every 1.2 mm of the way where there is a force
  std::optional<Vec3> last_arrow;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const ChainTick& tick = run.ticks[i];
    const Vec3 p = tick.X_WT.p, f = tick.report.wrench_W.force_N;  // CLAMPING alone is live in this scene
    const bool arrow = tick.report.clamping_N > 0.03 && (!last_arrow || norm(p - *last_arrow) > 0.0012);
    if (arrow) last_arrow = p;
    table.row({run.time_s(i), p.x, p.y, p.z, f.x, f.y, f.z, tick.report.clamping_N,
               tick.report.lateral_error_m, tick.report.insertion_m, arrow ? 1.0 : 0.0},
              {phaseName(tick.report.phase)});
  }
  figure.csv = table.take();

  const Places places = placesOf(run);
  const Vec3 p0 = run.ticks[places.entry.value_or(0)].X_WT.p;
  const Vec3 u0 = zAxis(run.ticks[places.entry.value_or(0)].X_WT.q);
  // the changed trajectory, from P0 through the foot of the last point 2: p plus the error towards the line
  const ChainTick& end = run.ticks[places.point2];
  const double f = norm(end.report.wrench_W.force_N);
  const Vec3 foot =
      f > 0 ? end.X_WT.p + end.report.wrench_W.force_N * (end.report.lateral_error_m / f) : end.X_WT.p;
  const Vec3 u2 = normalized(foot - p0);
  figure.script = figureStyle() + line3(p0, p0 + u0 * 0.044, "nohead ls 6") +
                  line3(p0, p0 + u2 * 0.046, "nohead ls 6") + pointLabel(p0, "Start", "-6.5,0.6") +
                  pointLabel(run.ticks[places.point1].X_WT.p, "1", "-2.2,-0.4") +
                  pointLabel(end.X_WT.p, "2", "1.2,-0.6") + "table = " + quoted(csv_path.string()) +
                  "\nmm_per_N = " + fixed(kArrow_mm_per_N, 1) + "\nset label '' at " +
                  inMillimetres(kTarget_W_m) + R"( point pt 6 ps 3.2 lw 1.6 lc rgb '#2a8a4a' front
set label 100 'Virtual fixture: tool path and clamping forces' at screen 0.5, 0.965 center font 'DejaVu Sans Bold,16' textcolor rgb '#1c2329'
set border 4095 lc rgb '#9aa4ad' lw 0.8
set view 76, 24, 1.2, 1.05
set xyplane at -42
set xrange [-16:20]
set yrange [-14:14]
set zrange [-42:22]
set xtics 10 offset 0,-0.3
set ytics 10 offset 0.5,0
set ztics 10
set xlabel 'x [mm]' offset 0,-0.8
set ylabel 'y [mm]' offset 1.5,-0.5
set zlabel 'z [mm]' rotate by 90 offset -2.5,0
set lmargin at screen 0.1
set key bmargin center horizontal maxrows 2 maxcols 3 nobox Left reverse font 'DejaVu Sans,12'
set object 1 polygon from -16,-14,0 to 20,-14,0 to 20,14,0 to -16,14,0 to -16,-14,0 fs transparent solid 0.25 border lc rgb '#d8a48f' fc rgb '#f0c9b8'
set label 'skin' at -15,-13,1.5 font 'DejaVu Sans,10' textcolor rgb '#a8664d'
# only the rows that are marked carry an arrow
splot table using ($11 > 0 ? $2*1000 : 1/0):($3*1000):($4*1000):($5*mm_per_N):($6*mm_per_N):($7*mm_per_N) \
        skip 1 with vectors head filled size screen 0.009,16,60 ls 5 lw 1.3 title sprintf('clamping force (%g mm/N)', mm_per_N), \
      '' using ($2*1000):($3*1000):($4*1000) skip 1 with lines ls 1 title 'needle tip', \
      '' using ($2*1000):($3*1000):(-42) skip 1 with lines lc rgb '#c3cad1' lw 1.6 title 'its shadow', \
      1/0 with lines ls 6 title 'reference trajectories', \
      1/0 with points pt 6 ps 2 lw 1.6 lc rgb '#2a8a4a' title 'target'
)";
  return figure;
}

Figure figure11(const FigureRun& run, const std::filesystem::path& csv_path) {
  Figure figure{"fig11", "Clamping force over time", {}, {}, 1200, 800};
  FigureTable table("t_s,clamping_n,lateral_error_m,insertion_m,stiffness_n_per_m,turning,phase");
  double most = 0;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const StepReport& report = run.ticks[i].report;
    const bool turning = (report.flags & kFlagTurn) != 0;
    most = std::max(most, report.clamping_N);
    table.row({run.time_s(i), report.clamping_N, report.lateral_error_m, report.insertion_m,
               report.clamping_stiffness_N_per_m, turning ? 1.0 : 0.0},
              {phaseName(report.phase)});
  }
  figure.csv = table.take();

  const Places places = placesOf(run);
  const auto spans = phaseSpans(run, 0.15);
  const double end_s = run.time_s(run.ticks.size() - 1);
  const auto mark = [&](std::size_t i, const std::string& name) {
    const std::string t = fixed(run.time_s(i), 3);
    return "set arrow from " + t + ", graph 0 to " + t + ", graph 1 nohead ls 6\nset label '" + name +
           "' at " + t + ", graph 0.94 offset 0.5,0 font 'DejaVu Sans Bold,11' textcolor rgb '#1c2329'\n";
  };
  const std::string marks =
      mark(places.entry.value_or(0), "Start") + mark(places.point1, "1") + mark(places.point2, "2");
  const std::string file = quoted(csv_path.string());
  figure.script = figureStyle() + phaseShades(spans, 1) + R"(set multiplot
set lmargin at screen 0.075
set rmargin at screen 0.97
set xrange [0:)" + fixed(end_s, 2) +
                  R"(]
set format x ''
set tmargin at screen 0.88
set bmargin at screen 0.45
set yrange [0:)" + fixed(most * 1.4, 2) +
                  R"(]
set ylabel '|f_{clamping}| [N]'
set key top right
set label 100 'Clamping force: in, back, change of trajectory, in, out' at screen 0.5, 0.965 center font 'DejaVu Sans Bold,16' textcolor rgb '#1c2329'
)" + phaseNames(spans, 0, end_s) +
                  marks + "plot " + file +
                  R"( using 1:2 skip 1 with lines ls 5 lw 2.4 title 'clamping force', \
     '' using 1:($6 > 0 ? $2 : 1/0) skip 1 with lines lc rgb '#6a1b4d' lw 3.4 title 'trajectory turns'
unset label
set tmargin at screen 0.42
set bmargin at screen 0.1
set format x '%g'
set xlabel 'time [s]'
set ylabel '[mm]'
set yrange [0:62]
set ytics 10
plot )" + file + R"( using 1:($4*1000) skip 1 with lines ls 1 title 'inserted length', \
     '' using 1:($3*1000) skip 1 with lines ls 2 dt 1 title 'distance from the trajectory'
unset multiplot
)";
  return figure;
}

}  // namespace needlelab
