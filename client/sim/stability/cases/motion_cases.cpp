/// Cases of prescribed motion: the tip follows the case's path regardless of the force.

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "client/sim/stability/case.h"

namespace needlelab {
namespace {

// Models with a tracking wall: their force decays during a stop.
double axialOf(const StepReport& report) {
  return report.cutting_N + report.attracted_N;
}

// Energy that the wall has given to the hand since tick `from`, minus the energy released by its spring
// (f²/2K) since then; maximum over the ticks with a still tip.
double createdEnergy(const MotionRun& run, std::size_t from, double stiffness) {
  const auto stored = [&](std::size_t k) {
    const double f = axialOf(run.ticks[k].report);
    return f * f / (2 * stiffness);
  };
  double work = 0, created = 0;
  for (std::size_t k = from + 1; k < run.ticks.size(); ++k) {
    const MotionTick &before = run.ticks[k - 1], &now = run.ticks[k];
    const double way = -(now.tip.p_WT_m.z - before.tip.p_WT_m.z);
    work += 0.5 * (axialOf(before.report) + axialOf(now.report)) * way;
    if (way == 0) created = std::max(created, work + stored(k) - stored(from));
  }
  return created;
}

std::size_t tickAt(double time_s) {
  return static_cast<std::size_t>(time_s * kMotionRate_hz + 0.5);
}

Result<MotionRun> moved(Trial& t, const HandPlan& plan) {
  return t.move(samplesOf(plan, kMotionRate_hz));
}

Status retreatInRamp(Trial& t) {
  if (!t.hasStop()) return t.notApplicable("has no stop: there is no ramp to retreat in");
  const double depth = t.number("depth_m", 0.005, 0.05), speed_in = t.number("speed_in_m_s", 1e-3, 1),
               rest_s = t.number("rest_s", 0.1, 10), limit = t.number("limit", 0);
  double created = 0;
  for (const double retreat : t.numbers("retreats_m"))
    for (const double speed : t.numbers("speeds_m_s"))
      for (const double wait : t.numbers("after_s")) {
        HandPlan plan(upright(-0.002));
        plan.moveTo(upright(depth), speed_in, Motion::kLinear).hold(wait);
        const std::size_t from = tickAt(plan.duration_s());
        plan.moveIn(upright(depth - retreat), retreat / speed, Motion::kLinear).hold(rest_s);
        plan.moveIn(upright(depth), retreat / speed, Motion::kLinear).hold(rest_s);
        ASSIGN_OR_RETURN(const auto run, moved(t, plan));
        created = std::max(created, createdEnergy(run, from, t.scene.tracking_wall.stiffness_N_per_m));
      }
  t.row().energy_J = created;
  t.judge("energy given beyond what the spring had stored [J]", created, limit);
  return {};
}

Status exitNormal(Trial& t) {
  const TimedPlan path = t.path();
  const TimeWindow window = t.window(path);
  ASSIGN_OR_RETURN(const auto run, moved(t, path.plan));
  double step = 0;
  const std::size_t to = std::min(tickAt(window.to_s), run.ticks.size());
  for (std::size_t k = std::max<std::size_t>(tickAt(window.from_s), 1); k < to; ++k)
    step =
        std::max(step, norm(run.ticks[k].report.wrench_W.force_N - run.ticks[k - 1].report.wrench_W.force_N));
  t.judge("greatest force step on the last of the way out [N]", step, t.number("limit", 0));
  return {};
}

Status beyondTheNeedle(Trial& t) {
  const double torque_limit = t.number("torque_limit_nm", 0);
  const PassivityGesture motion = t.motion();
  ASSIGN_OR_RETURN(const auto run, t.move(samplesOf(motion), motion.rate_hz));
  const PassivityRecord record = observed(run);
  t.judge("greatest force step beyond the springs' slope [N]", record.worst_step_N, t.number("limit", 0));
  // the run must reach this region, and the torque must not step either
  if ((record.flags & kFlagBeyondNeedle) != 0 && record.worst_torque_step_Nm <= torque_limit) return {};
  t.require(false);
  t.row().note = fmt::format("torque steps by {:f} N·m", record.worst_torque_step_Nm);
  return {};
}

// Two or three layers with membranes lie within one tick's motion. After them the force must be as if each
// layer had been met separately, as in a run at ten times the rate. For the wall there is also a formula.
Status layersInOneTick(Trial& t) {
  constexpr std::size_t kFiner = 10;
  const TimedPlan path = t.path();
  const double behind_m = t.number("behind_m", 0, 1), finer_hz = kMotionRate_hz * kFiner;
  ASSIGN_OR_RETURN(const auto coarse, moved(t, path.plan));
  ASSIGN_OR_RETURN(const auto fine, runMotion(t.source, t.scene, samplesOf(path.plan, finer_hz), finer_hz));
  const auto& ticks = coarse.ticks;
  std::size_t deep = 0;  // first tick below them
  while (deep < ticks.size() && ticks[deep].report.depth_m < behind_m) ++deep;
  double departure_N = deep < ticks.size() ? 0 : HUGE_VAL;
  int in_a_tick = 0;
  for (std::size_t k = 1; k < ticks.size(); ++k) {
    in_a_tick = std::max(in_a_tick, ticks[k].report.layer - ticks[k - 1].report.layer);
    const std::size_t same = std::min(k * kFiner, fine.ticks.size() - 1);
    if (k >= deep)
      departure_N = std::max(
          departure_N, norm(ticks[k].report.wrench_W.force_N - fine.ticks[same].report.wrench_W.force_N));
  }
  t.judge("departure from ten times the rate, behind them [N]", departure_N, t.number("limit", 0),
          fmt::format("up to {} layers in a tick", in_a_tick));
  t.require(in_a_tick >= 2);
  return {};
}

Status tiltPump(Trial& t) {
  const PassivityGesture motion = t.motion();
  ASSIGN_OR_RETURN(const auto run, t.move(samplesOf(motion), motion.rate_hz));
  const double net_J = observed(run).net_J;
  t.row().energy_J = net_J;
  t.judge("net energy given in a cycle tilt, in, upright, out [J]", net_J, t.number("limit", 0));
  return {};
}

Status startsInside(Trial& t) {
  const TimedPlan path = t.path();
  ASSIGN_OR_RETURN(const auto run, moved(t, path.plan));
  bool outside = false;
  double before = 0, after = 0;
  for (const MotionTick& tick : run.ticks) {
    outside = outside || tick.report.depth_m <= 0;
    double& seen = outside ? after : before;
    seen = std::max(seen, norm(tick.report.wrench_W.force_N));
  }
  t.judge("greatest force before the tip was outside [N]", before, t.number("limit", 0));
  // zero force throughout must not pass either
  if (after > kAnyForce_N) return {};
  t.require(false);
  t.row().note = "no force after the tip was outside";
  return {};
}

}  // namespace

std::vector<StabilityCase> motionCases() {
  std::vector<StabilityCase> cases = {
      {"retreat_in_ramp", retreatInRamp},
      {"tilt_pump", tiltPump, false},
      {"exit_normal", exitNormal},
      {"beyond_the_needle", beyondTheNeedle},
      {"layers_in_one_tick", layersInOneTick},
      {"starts_inside", startsInside},
  };
  for (StabilityCase& one : gateCases()) cases.push_back(std::move(one));
  return cases;
}

}  // namespace needlelab
