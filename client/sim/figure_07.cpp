/// Fig. 7: the tracking wall in one degree of freedom. 1 N on the way in, decay in an intentional stop, 0.5 N
/// on the way out.
#include <limits>

#include "client/sim/tools/figure_table.h"

namespace needlelab {
namespace {

constexpr double kRate = 1000;

HandPlan oneLayerPlan() {
  // straight along z; the times are the paper's: in from 24 s to 27 s, rest to 29.5 s, out to 31.5 s
  const Quat down = orientationAlong({0, 0, -1});
  const auto at = [&](double z_m) { return Pose{{0, 0, z_m}, down}; };
  HandPlan plan(at(0.02));
  plan.hold(0.8)                                   // 21.5 s
      .moveIn(at(0.006), 0.9, Motion::kMinJerk)    // 22.3 s: towards the skin
      .moveIn(at(-0.03), 3.8, Motion::kTrapezoid)  // 23.2 s: through the skin at 24.0 s, at full speed
      .hold(2.5)                                   // 27.0 s
      .moveIn(at(0.004), 2.2, Motion::kTrapezoid)  // 29.5 s: out of the skin at about 31.5 s
      .moveIn(at(0.02), 0.9, Motion::kMinJerk)
      .hold(0.4);
  return plan;
}

// speed between the means of the 0.1 s before and after: what a reader means by it, without tremor and
// encoder steps
double smoothSpeed_z(const FigureRun& run, std::size_t i) {
  const auto reach = static_cast<std::size_t>(0.1 * run.rate_hz);
  if (i < reach || i + reach >= run.ticks.size()) return std::numeric_limits<double>::quiet_NaN();
  double change = 0;
  for (std::size_t k = 0; k < reach; ++k)
    change += run.ticks[i + 1 + k].X_WT.p.z - run.ticks[i - 1 - k].X_WT.p.z;
  // the means are (reach + 1) ticks apart
  return change / static_cast<double>(reach) / (static_cast<double>(reach + 1) / run.rate_hz);
}

}  // namespace

Result<FigureRun> runOneLayer() {
  const auto model = paperScene("paper-1dof", {}, kRate);
  if (!model.ok()) return model.error();
  return runPlan(*model, {}, oneLayerPlan(), 21.5);
}

Figure figure07(const FigureRun& run, const std::filesystem::path& csv_path) {
  Figure figure{"fig07", "Tracking wall, 1 DoF", {}, {}, 1200, 1000};
  FigureTable table(
      "t_s,z_m,wall_z_m,speed_z_m_s,force_z_n,rendered_force_z_n,cutting_n,attracted_n,depth_m,phase");
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const ChainTick& tick = run.ticks[i];
    const StepReport& report = tick.report;
    table.row(
        {run.time_s(i), tick.X_WT.p.z, report.p_wall_W_m.z, smoothSpeed_z(run, i), report.wrench_W.force_N.z,
         tick.rendered_W.force_N.z, report.cutting_N, report.attracted_N, report.depth_m},
        {phaseName(report.phase)});
  }
  figure.csv = table.take();

  const auto spans = phaseSpans(run, 0.1);
  const std::string file = quoted(csv_path.string());
  figure.script = figureStyle() + phaseShades(spans, 1) + R"(set multiplot
set xrange [22:33]
set lmargin at screen 0.085
set rmargin at screen 0.97
set format x ''
set label 100 'Enhanced tracking wall in 1 DoF: 1 N in, decay in the stop, 0.5 N out' at screen 0.5, 0.975 center font 'DejaVu Sans Bold,16' textcolor rgb '#1c2329'
)" + phaseNames(spans, 22, 33) +
                  R"(set tmargin at screen 0.91
set bmargin at screen 0.635
set ylabel 'position z [mm]' offset 0.5,0
set yrange [-36:26]
set ytics 10
set key bottom left
set arrow 1 from 22,0 to 33,0 nohead ls 6
set label 101 'skin' at 22.12,2.6 font 'DejaVu Sans,10' textcolor rgb '#7d8790'
plot )" + file + R"( using 1:($2*1000) skip 1 with lines ls 1 title 'needle tip', \
     '' using 1:($3*1000) skip 1 with lines ls 2 title 'wall ω_n'
unset label
unset arrow 1
set tmargin at screen 0.605
set bmargin at screen 0.39
set ylabel 'speed v_z [mm/s]'
set yrange [-50:45]
set ytics 20
set key top left
set arrow 1 from 22,0 to 33,0 nohead ls 6
plot )" + file + R"( using 1:($4*1000) skip 1 with lines ls 1 title 'needle tip'
set tmargin at screen 0.36
set bmargin at screen 0.085
set format x '%g'
set xlabel 'time [s]'
set ylabel 'force on the hand f_z [N]'
set yrange [-0.75:1.35]
set ytics 0.5
set key top right
set arrow 2 from 22,1 to 33,1 nohead ls 6
set arrow 3 from 22,-0.5 to 33,-0.5 nohead ls 6
plot )" + file + R"( using 1:5 skip 1 with lines lc rgb '#4a5560' lw 2 title 'no force', \
     '' using 1:($7 < 0 ? $5 : 1/0) skip 1 with lines ls 3 title 'cutting force', \
     '' using 1:($8 > 0 ? $5 : 1/0) skip 1 with lines ls 4 title 'attracted force'
unset multiplot
)";
  return figure;
}

}  // namespace needlelab
