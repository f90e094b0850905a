/// Fig. 7: the tracking wall in one degree of freedom: 1 N on the way in, decay during an intentional stop,
/// 0.5 N on the way out. Figs. 8 and 9: six layers of 1, 2, 1.5, 2.5, 3 and 4 N, 0.4 N on the way out, in
/// three degrees of freedom. Figs. 10 and 11: the virtual fixture: in with a sideways drift, partly drawn
/// back, trajectory changed, in to the target, out.
#include "client/sim/figures.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace needlelab {
namespace {

// ---- phases

// A run of ticks with the same phase.
struct PhaseSpan {
  Phase phase = Phase::kFree;
  double from_s = 0, to_s = 0;
};

// Ordered, without gaps; spans shorter than `min_s` join the previous one.
std::vector<PhaseSpan> phaseSpans(const FigureRun& run, double min_s) {
  std::vector<PhaseSpan> raw;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const Phase phase = run.ticks[i].report.phase;
    if (raw.empty() || raw.back().phase != phase) raw.push_back({phase, run.time_s(i), run.time_s(i)});
    raw.back().to_s = run.time_s(i) + 1 / run.rate_hz;
  }
  std::vector<PhaseSpan> spans;
  for (const PhaseSpan& span : raw) {
    const bool joins =
        !spans.empty() && (span.to_s - span.from_s < min_s || spans.back().phase == span.phase);
    if (joins)
      spans.back().to_s = span.to_s;
    else
      spans.push_back(span);
  }
  return spans;
}

// For phases.gp: start, end and name of each span.
PlotVariable phasesOf(const FigureRun& run, double min_s) {
  std::string text;
  for (const PhaseSpan& span : phaseSpans(run, min_s))
    text += fmt::format("{:.4f} {:.4f} {} ", span.from_s, span.to_s, phaseName(span.phase));
  return {"phases", text};
}

std::vector<double> inMillimetres(Vec3 p_m) {
  return {p_m.x * 1000, p_m.y * 1000, p_m.z * 1000};
}

// ---- figure 7

constexpr double kOneLayerRate_hz = 1000;

HandPlan oneLayerPlan() {
  // Straight along z. Times are the paper's: in from 24 s to 27 s, rest to 29.5 s, out to 31.5 s.
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

// Speed between the means of the 0.1 s before and after; removes tremor and encoder steps.
double smoothSpeed_z(const FigureRun& run, std::size_t i) {
  const auto reach = static_cast<std::size_t>(0.1 * run.rate_hz);
  if (i < reach || i + reach >= run.ticks.size()) return std::numeric_limits<double>::quiet_NaN();
  double change = 0;
  for (std::size_t k = 0; k < reach; ++k)
    change += run.ticks[i + 1 + k].X_WT.p.z - run.ticks[i - 1 - k].X_WT.p.z;
  // the means are (reach + 1) ticks apart
  return change / static_cast<double>(reach) / (static_cast<double>(reach + 1) / run.rate_hz);
}

// ---- figures 8 and 9

constexpr char kSixLayerScene[] =
    "A simulated hand; forces, tissues and K_t are the paper's; thicknesses, place of the skin, grip and "
    "motion are set by "
    "hand.";
constexpr double kFilmRate_hz = 1000;
constexpr double kLeadIn_s = 0.8;  // rest before the figure's time 0; the gate's fade-in has ended by then

// The skin somewhere in the device's workspace, oblique to all three axes.
Pose obliqueSkin() {
  return {{0.45, 0.08, 0.12}, orientationAlong({0.45, -0.35, 0.82})};
}

// A firm grip, as for a quick push into hard tissue.
SimulatedDeviceOptions firmGrip() {
  SimulatedDeviceOptions device;
  device.hand.stiffness_N_per_m = 900;
  device.hand.damping_Ns_per_m = 15;
  return device;
}

// In from 0 s to 0.75 s, out to 1.5 s, as in the paper.
HandPlan sixLayerPlan() {
  const Pose X_WL = obliqueSkin();
  const Vec3 in = -zAxis(X_WL.q);
  const Quat q = orientationAlong(in);
  const auto at = [&](double depth_m) { return Pose{X_WL.p + in * depth_m, q}; };
  // the hand aims beyond the tip's goal: at 4 N its spring yields by 4.4 mm
  HandPlan plan(at(-0.015));
  plan.hold(kLeadIn_s - 0.24)
      .moveIn(at(0.056), 0.97, Motion::kTrapezoid)
      .moveIn(at(-0.03), 1.03, Motion::kTrapezoid)
      .hold(0.1);
  return plan;
}

// ---- figures 10 and 11

constexpr char kClampingScene[] =
    "A simulated hand; scene, motion and all numbers are set by hand: the paper gives none.";
constexpr double kClampingRate_hz = 1000;
constexpr Vec3 kTarget_W_m{0.008, 0, -0.036};  // the profile's target
constexpr Vec3 kBeyond{0.00125, 0, 0};         // the hand aims beyond the target, because its spring yields
constexpr double kArrow_mm_per_N = 6;

HandPlan clampingPlan() {
  const Vec3 first = normalized(Vec3{-0.22, 0.10, -1});          // the user's initial direction
  const Vec3 aside = normalized(cross(first, Vec3{0.3, 1, 0}));  // direction of the drift
  const Vec3 right = normalized(kTarget_W_m);                    // direction to the target
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

// Ticks of the places named in the paper's text: the start, point 1 (the user gives up), point 2 (the
// trajectory changes), and the target.
struct Places {
  std::optional<std::size_t> entry, point2;
  std::size_t point1 = 0, target = 0;
};

Places placesOf(const FigureRun& run) {
  Places places;
  double deepest1 = 0, nearest = 1e9;
  bool gave_up = false;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const StepReport& report = run.ticks[i].report;
    if (!places.entry && (report.flags & kFlagEntry) != 0) places.entry = i;
    // Near the skin u always follows the hand; the change is the turn after the user gave up at point 1.
    if (!gave_up && report.insertion_m > deepest1) deepest1 = report.insertion_m, places.point1 = i;
    gave_up = gave_up || (deepest1 > 0.02 && report.insertion_m < 0.6 * deepest1);
    if (gave_up && !places.point2 && (report.flags & kFlagTurn) != 0) places.point2 = i;
    if (const double away = norm(run.ticks[i].X_WT.p - kTarget_W_m); away < nearest)
      nearest = away, places.target = i;
  }
  return places;
}

}  // namespace

Result<FigureRun> runOneLayer() {
  ASSIGN_OR_RETURN(const auto model, paperScene("paper-1dof", {}, kOneLayerRate_hz));
  return runPlan(model, {}, oneLayerPlan(), 21.5);
}

Figure figure07(const FigureRun& run) {
  Figure figure{"fig07", "Tracking wall, 1 DoF", {}, {}};
  PlotTable table(
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
  figure.variables = {phasesOf(run, 0.1)};
  return figure;
}

Result<FigureRun> runSixLayers() {
  ASSIGN_OR_RETURN(const auto model, paperScene("paper-six-layers", obliqueSkin(), kFilmRate_hz));
  return runPlan(model, firmGrip(), sixLayerPlan(), -kLeadIn_s);
}

Figure figure08(const FigureRun& run) {
  Figure figure{"fig08", "Tracking wall, 3 DoF: positions", {}, {}};
  PlotTable table("t_s,px_m,py_m,pz_m,wx_m,wy_m,wz_m,depth_m,layer,phase");
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const Vec3 p = run.ticks[i].X_WT.p;
    const StepReport& report = run.ticks[i].report;
    const Vec3 w = report.p_wall_W_m;
    table.row(
        {run.time_s(i), p.x, p.y, p.z, w.x, w.y, w.z, report.depth_m, static_cast<double>(report.layer)},
        {phaseName(report.phase)});
  }
  figure.csv = table.take();
  figure.variables = {phasesOf(run, 0.02), {"scene", kSixLayerScene}};
  return figure;
}

Figure figure09(const FigureRun& run) {
  Figure figure{"fig09", "Cutting and attracted forces, 3 DoF", {}, {}};
  PlotTable table("t_s,cutting_force_n,attracted_force_n,axial_force_n,fx_n,fy_n,fz_n,depth_m,layer,phase");
  // when each layer is first reached and when the way out begins, for the marks
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
  starts_s.push_back(turn_s);
  figure.variables = {phasesOf(run, 0.02), {"layer_s", starts_s}, {"scene", kSixLayerScene}};
  return figure;
}

Result<FigureRun> runClamping() {
  ASSIGN_OR_RETURN(const auto model, paperScene("paper-clamping", {}, kClampingRate_hz));
  return runPlan(model, {}, clampingPlan(), 0);
}

Figure figure10(const FigureRun& run) {
  Figure figure{"fig10", "Virtual fixture: path and clamping forces", {}, {}};
  PlotTable table("t_s,px_m,py_m,pz_m,fx_n,fy_n,fz_n,clamping_n,lateral_error_m,insertion_m,arrow,phase");
  // an arrow every 1.2 mm of the path where there is a force
  std::optional<Vec3> last_arrow;
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const ChainTick& tick = run.ticks[i];
    const Vec3 p = tick.X_WT.p, f = tick.report.wrench_W.force_N;  // only CLAMPING is live in this scene
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
  // The changed trajectory: from P0 through the tip's foot point at the target, i.e. p plus the error towards
  // the line.
  const ChainTick& end = run.ticks[places.target];
  const double f = norm(end.report.wrench_W.force_N);
  const Vec3 foot =
      f > 0 ? end.X_WT.p + end.report.wrench_W.force_N * (end.report.lateral_error_m / f) : end.X_WT.p;
  const Vec3 u2 = normalized(foot - p0);
  figure.variables = {{"start", inMillimetres(p0)},
                      {"first_way", inMillimetres(p0 + u0 * 0.044)},
                      {"changed_way", inMillimetres(p0 + u2 * 0.046)},
                      {"point1", inMillimetres(run.ticks[places.point1].X_WT.p)},
                      {"point2", inMillimetres(run.ticks[places.point2.value_or(0)].X_WT.p)},
                      {"target", inMillimetres(kTarget_W_m)},
                      {"mm_per_n", kArrow_mm_per_N},
                      {"scene", kClampingScene}};
  return figure;
}

Figure figure11(const FigureRun& run) {
  Figure figure{"fig11", "Clamping force over time", {}, {}};
  PlotTable table("t_s,clamping_n,lateral_error_m,insertion_m,stiffness_n_per_m,turning,phase");
  for (std::size_t i = 0; i < run.ticks.size(); ++i) {
    const StepReport& report = run.ticks[i].report;
    const bool turning = (report.flags & kFlagTurn) != 0;
    table.row({run.time_s(i), report.clamping_N, report.lateral_error_m, report.insertion_m,
               report.clamping_stiffness_N_per_m, turning ? 1.0 : 0.0},
              {phaseName(report.phase)});
  }
  figure.csv = table.take();

  const Places places = placesOf(run);
  figure.variables = {phasesOf(run, 0.15),
                      {"start_s", run.time_s(places.entry.value_or(0))},
                      {"point1_s", run.time_s(places.point1)},
                      {"point2_s", run.time_s(places.point2.value_or(0))},
                      {"target_s", run.time_s(places.target)},
                      {"scene", kClampingScene}};
  return figure;
}

}  // namespace needlelab
