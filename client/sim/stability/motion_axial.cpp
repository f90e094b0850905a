/// Prescribed motion along the needle: retreat in a stop, exits, deeper than the needle is long.
#include <algorithm>
#include <array>

#include "client/sim/stability/motion_cases.h"
#include "client/sim/stability/motion_run.h"

namespace needlelab {
namespace {

// the models whose force fades in a stop, because their wall is the tracking wall
double axialOf(const StepReport& report) {
  return report.cutting_N + report.attracted_N;
}

// Energy that the wall gave to the hand from tick `from` on beyond what its spring f²/2K had stored then and
// has no longer; greatest over the ticks at which the tip stands still.
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

double greatestStep(const MotionRun& run, std::size_t from, std::size_t to) {
  double step = 0;
  for (std::size_t k = std::max<std::size_t>(from, 1); k < std::min(to, run.ticks.size()); ++k)
    step =
        std::max(step, norm(run.ticks[k].report.wrench_W.force_N - run.ticks[k - 1].report.wrench_W.force_N));
  return step;
}

std::size_t tickAt(double time_s, double rate_hz) {
  return static_cast<std::size_t>(time_s * rate_hz + 0.5);
}

}  // namespace

Result<CaseOutcome> retreatInRamp(const CaseSettings& settings, AxialModel model,
                                  const ForceSourceFactory& source) {
  CaseOutcome outcome;
  if (!hasStop(model)) {
    outcome.row.note = "has no stop: there is no ramp to retreat in";
    return outcome;
  }
  CaseEntry entry(settings.file, "retreat_in_ramp", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const double depth = entry.number("depth_m", 0.005, 0.05), speed_in = entry.number("speed_in_m_s", 1e-3, 1);
  const double rest_s = entry.number("rest_s", 0.1, 10), rate = entry.number("rate_hz", 50, 40'000);
  const auto retreats = entry.numbers("retreats_m"), speeds = entry.numbers("speeds_m_s");
  const auto waits = entry.numbers("after_s");
  const double limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();

  const auto at = [](double d) { return Pose{{0, 0, -d}, orientationAlong({0, 0, -1})}; };
  double created = 0;
  PassivityRecord worst;
  for (const double retreat : retreats)
    for (const double speed : speeds)
      for (const double wait : waits) {
        HandPlan plan(at(-0.002));
        plan.moveTo(at(depth), speed_in, Motion::kLinear).hold(wait);
        const std::size_t from = tickAt(plan.duration_s(), rate);
        plan.moveIn(at(depth - retreat), retreat / speed, Motion::kLinear).hold(rest_s);
        plan.moveIn(at(depth), retreat / speed, Motion::kLinear).hold(rest_s);
        const auto run = runMotion(source, scene, samplesOf(plan, rate), rate);
        if (!run.ok()) return run.error();
        created = std::max(created, createdEnergy(*run, from, scene.tracking_wall.stiffness_N_per_m));
        const PassivityRecord record = observed(*run);
        worst.finite = worst.finite && record.finite;
        worst.max_force_N = std::max(worst.max_force_N, record.max_force_N);
        worst.worst_step_N = std::max(worst.worst_step_N, record.worst_step_N);
        if (outcome.traces.empty() && retreat == retreats.back())
          outcome.traces.push_back(forceTrace(*run, std::string(axialModelName(model))));
      }
  outcome.row = rowOf(worst);
  outcome.row.energy_J = created;
  judgeMotion(outcome.row, "energy given beyond what the spring had stored [J]", created, limit);
  return outcome;
}

Result<CaseOutcome> exitNormal(const CaseSettings& settings, AxialModel model,
                               const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "exit_normal", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const TimedPlan path = entry.path();
  const TimeWindow window = entry.window(path);
  const double rate = entry.number("rate_hz", 50, 40'000), limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();
  const auto run = runMotion(source, scene, samplesOf(path.plan, rate), rate);
  if (!run.ok()) return run.error();
  CaseOutcome outcome{rowOf(observed(*run)), {forceTrace(*run, std::string(axialModelName(model)))}};
  const double step = greatestStep(*run, tickAt(window.from_s, rate), tickAt(window.to_s, rate));
  judgeMotion(outcome.row, "greatest force step on the last of the way out [N]", step, limit);
  return outcome;
}

Result<CaseOutcome> sphereFarSide(const CaseSettings& settings, AxialModel model,
                                  const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "sphere_far_side", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const TimedPlan path = entry.path();
  const double rate = entry.number("rate_hz", 50, 40'000), above = entry.number("limit_above_cutting_n", 0);
  if (!entry.status().ok()) return entry.status().error();
  const auto run = runMotion(source, scene, samplesOf(path.plan, rate), rate);
  if (!run.ok()) return run.error();
  CaseOutcome outcome{rowOf(observed(*run)), {forceTrace(*run, std::string(axialModelName(model)))}};
  judgeMotion(outcome.row, "greatest force step, the far side included [N]",
              greatestStep(*run, 1, run->ticks.size()), scene.layers.front().cutting_force_N + above);
  if (!(run->ticks.back().report.depth_m < 0)) outcome.row.passed = false;
  return outcome;
}

Result<CaseOutcome> beyondTheNeedle(const CaseSettings& settings, AxialModel model,
                                    const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "beyond_the_needle", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const double limit = entry.number("limit", 0), torque_limit = entry.number("torque_limit_nm", 0);
  if (!entry.status().ok()) return entry.status().error();
  const auto motion = motionOf(settings, "beyond_the_needle");
  if (!motion.ok()) return motion.error();
  const auto run = runMotion(source, scene, samplesOf(*motion), motion->rate_hz);
  if (!run.ok()) return run.error();

  const PassivityRecord record = observed(*run);
  CaseOutcome outcome{rowOf(record), {forceTrace(*run, std::string(axialModelName(model)))}};
  judgeMotion(outcome.row, "greatest force step beyond the springs' slope [N]", record.worst_step_N, limit);
  // the case is about what happens there: it must have been there, and torque must not step either
  if (!(record.flags & kFlagBeyondNeedle) || record.worst_torque_step_Nm > torque_limit) {
    outcome.row.passed = false;
    outcome.row.verdict = Verdict::kChatters;
    outcome.row.note = "torque steps by " + std::to_string(record.worst_torque_step_Nm) + " N·m";
  }
  return outcome;
}

}  // namespace needlelab
