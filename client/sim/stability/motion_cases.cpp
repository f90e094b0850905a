#include "client/sim/stability/motion_cases.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "client/sim/stability/passivity_observer.h"
#include "client/sim/stability/passivity_search.h"

namespace needlelab {
namespace {

// a case of the gate: as shipped, with it
template <auto Run>
Result<CaseOutcome> gated(const CaseSettings& settings, AxialModel model, const ForceSourceFactory& source) {
  return Run(settings, model, source, Gate::kPresent);
}

}  // namespace

std::vector<StabilityCase> motionCases() {
  return {
      {"retreat_in_ramp", "the needle is drawn back while the force of a stop fades", true, true,
       retreatInRamp},
      {"tilt_pump", "tilted while shallow, in, upright, out: the tilt limit must not pay", false, true,
       tiltPump},
      {"exit_normal", "the pull on the way out fades to nothing at the skin", true, true, exitNormal},
      {"beyond_the_needle", "deeper than the needle is long, and out", true, true, beyondTheNeedle},
      {"layers_in_one_tick", "0.5 m/s through layers of which two or three lie within a tick's way", true,
       true, layersInOneTick},
      {"starts_inside", "the station starts with the tip in the tissue", true, true, startsInside},
      {"teleport", "the tip jumps by 50 mm", true, true, gated<teleport>},
      {"not_a_number", "position or orientation is not a number", true, true, gated<notANumber>},
      {"frozen_device", "the device stands still, or says nothing more", true, true, gated<frozenDevice>},
      {"flipped_axis", "the needle points out of the tissue; samples of any kind", true, true,
       gated<flippedAxis>},
      {"random_energy", "random gestures in random scenes under the passivity observer", true, true,
       randomEnergy},
  };
}

Result<MotionRun> runMotion(const ForceSourceFactory& make_source, const SceneSpec& scene,
                            const std::vector<TipSample>& samples, double rate_hz) {
  ASSIGN_OR_RETURN(auto source, make_source(scene, rate_hz));
  MotionRun run{rate_hz, source->axialStiffness_N_per_m(), {}};
  run.ticks.reserve(samples.size());
  for (const TipSample& tip : samples) {
    MotionTick& tick = run.ticks.emplace_back();
    tick.tip = tip;
    source->step(tip, tick.report);
    tick.slant = source->slant();
  }
  return run;
}

std::vector<TipSample> samplesOf(const HandPlan& plan, double rate_hz) {
  const auto ticks = static_cast<std::size_t>(std::floor(plan.duration_s() * rate_hz + 0.5)) + 1;
  std::vector<TipSample> samples;
  samples.reserve(ticks);
  for (std::size_t k = 0; k < ticks; ++k) {
    const Pose pose = plan.at(static_cast<double>(k) / rate_hz).X_WT;
    samples.push_back({pose.p, pose.q});
  }
  return samples;
}

Result<PassivityGesture> motionOf(const CaseSettings& settings, std::string_view case_name,
                                  std::string_view field) {
  const auto& cases = settings.file.json().at("cases");
  const std::string name(case_name), key(field);
  const std::string where = settings.file.source() + ": cases." + name + "." + key;
  const auto found = cases.find(name);
  if (found == cases.end() || !found->is_object() || !found->contains(key))
    return Error{ErrorCode::kInvalidInput, where + ": missing"};
  PassivityGesture gesture;
  RETURN_IF_ERROR(readMotion((*found)[key], where, gesture));
  return gesture;
}

PassivityRecord observed(const MotionRun& run, bool with_slant) {
  PassivityObserver observer(run.axial_stiffness_N_per_m);
  for (const MotionTick& tick : run.ticks) observer.add(tick.tip, tick.report, with_slant ? tick.slant : 1.0);
  return observer.record();
}

CaseRow rowOf(const PassivityRecord& record) {
  CaseRow row;
  row.finite = record.finite;
  row.max_force_N = record.max_force_N;
  row.max_unexplained_step_N = record.worst_step_N;
  row.energy_J = judgedEnergy_J(record);
  return row;
}

CaseRow rowOf(const std::vector<GatedTick>& ticks) {
  CaseRow row;
  row.finite = true;
  row.max_force_N = 0;
  for (const GatedTick& tick : ticks) {
    row.finite = row.finite && isFinite(tick.out_W.force_N) && isFinite(tick.out_W.torque_Nm);
    row.max_force_N = std::max(*row.max_force_N, norm(tick.out_W.force_N));
  }
  return row;
}

void judgeMotion(CaseRow& row, std::string quantity, double measured, double limit) {
  row.quantity = std::move(quantity);
  row.measured = measured;
  row.limit = limit;
  judge(row, false);
}

CaseTrace forceTrace(const MotionRun& run, std::string label) {
  CaseTrace trace{std::move(label), {}, {}};
  for (std::size_t k = 0; k < run.ticks.size(); ++k) {
    trace.time_s.push_back(static_cast<double>(k) / run.rate_hz);
    trace.force_N.push_back(norm(run.ticks[k].report.wrench_W.force_N));
  }
  return trace;
}

namespace {

// the models with a tracking wall: their force fades in a stop
double axialOf(const StepReport& report) {
  return report.cutting_N + report.attracted_N;
}

// Energy that the wall gave to the hand from tick `from` on, minus the energy released by its spring (f²/2K)
// since then; greatest over the ticks with a still tip.
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
        ASSIGN_OR_RETURN(const auto run, runMotion(source, scene, samplesOf(plan, rate), rate));
        created = std::max(created, createdEnergy(run, from, scene.tracking_wall.stiffness_N_per_m));
        const PassivityRecord record = observed(run);
        worst.finite = worst.finite && record.finite;
        worst.max_force_N = std::max(worst.max_force_N, record.max_force_N);
        worst.worst_step_N = std::max(worst.worst_step_N, record.worst_step_N);
        if (outcome.traces.empty() && retreat == retreats.back())
          outcome.traces.push_back(forceTrace(run, std::string(axialModelName(model))));
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
  ASSIGN_OR_RETURN(const auto run, runMotion(source, scene, samplesOf(path.plan, rate), rate));
  CaseOutcome outcome{rowOf(observed(run)), {forceTrace(run, std::string(axialModelName(model)))}};
  const double step = greatestStep(run, tickAt(window.from_s, rate), tickAt(window.to_s, rate));
  judgeMotion(outcome.row, "greatest force step on the last of the way out [N]", step, limit);
  return outcome;
}

Result<CaseOutcome> beyondTheNeedle(const CaseSettings& settings, AxialModel model,
                                    const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "beyond_the_needle", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const double limit = entry.number("limit", 0), torque_limit = entry.number("torque_limit_nm", 0);
  if (!entry.status().ok()) return entry.status().error();
  ASSIGN_OR_RETURN(const auto motion, motionOf(settings, "beyond_the_needle"));
  ASSIGN_OR_RETURN(const auto run, runMotion(source, scene, samplesOf(motion), motion.rate_hz));

  const PassivityRecord record = observed(run);
  CaseOutcome outcome{rowOf(record), {forceTrace(run, std::string(axialModelName(model)))}};
  judgeMotion(outcome.row, "greatest force step beyond the springs' slope [N]", record.worst_step_N, limit);
  // the run must have reached this region, and torque must not step either
  if (!(record.flags & kFlagBeyondNeedle) || record.worst_torque_step_Nm > torque_limit) {
    outcome.row.passed = false;
    outcome.row.verdict = Verdict::kChatters;
    outcome.row.note = fmt::format("torque steps by {:f} N·m", record.worst_torque_step_Nm);
  }
  return outcome;
}

namespace {

// force over time at `rate_hz`, and when the tip has come to `depth_m` for the first time
struct FastRun {
  MotionRun run;
  std::size_t deep_tick = 0;
};
Result<FastRun> fastRun(const ForceSourceFactory& source, const SceneSpec& scene, const HandPlan& plan,
                        double rate_hz, double depth_m) {
  ASSIGN_OR_RETURN(auto run, runMotion(source, scene, samplesOf(plan, rate_hz), rate_hz));
  FastRun fast{std::move(run), 0};
  while (fast.deep_tick < fast.run.ticks.size() && fast.run.ticks[fast.deep_tick].report.depth_m < depth_m)
    ++fast.deep_tick;
  return fast;
}

}  // namespace

// Two or three layers with membranes lie within the way of a tick. Behind them the force must be as if every
// layer had been met alone: that of a run of ten times the rate. For the wall it is also known by formula.
Result<CaseOutcome> layersInOneTick(const CaseSettings& settings, AxialModel model,
                                    const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "layers_in_one_tick", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const TimedPlan path = entry.path();
  const double rate = entry.number("rate_hz", 50, 4'000), behind_m = entry.number("behind_m", 0, 1);
  const double limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();
  constexpr std::size_t kFiner = 10;
  ASSIGN_OR_RETURN(const auto coarse, fastRun(source, scene, path.plan, rate, behind_m));
  ASSIGN_OR_RETURN(const auto fine, fastRun(source, scene, path.plan, rate * kFiner, behind_m));

  CaseOutcome outcome{rowOf(observed(coarse.run)),
                      {forceTrace(coarse.run, std::string(axialModelName(model)))}};
  double departure_N = coarse.deep_tick < coarse.run.ticks.size() ? 0 : HUGE_VAL;
  for (std::size_t k = coarse.deep_tick; k < coarse.run.ticks.size(); ++k) {
    const std::size_t same = std::min(k * kFiner, fine.run.ticks.size() - 1);
    departure_N = std::max(departure_N, norm(coarse.run.ticks[k].report.wrench_W.force_N -
                                             fine.run.ticks[same].report.wrench_W.force_N));
  }
  judgeMotion(outcome.row, "departure from ten times the rate, behind them [N]", departure_N, limit);
  int in_a_tick = 0;
  for (std::size_t k = 1; k < coarse.run.ticks.size(); ++k)
    in_a_tick = std::max(in_a_tick, coarse.run.ticks[k].report.layer - coarse.run.ticks[k - 1].report.layer);
  if (in_a_tick < 2) outcome.row.passed = false;
  outcome.row.note = fmt::format("up to {} layers in a tick", in_a_tick);
  return outcome;
}

namespace {

// the case's motion in its scene
struct Prescribed {
  SceneSpec scene;
  PassivityGesture motion;
  double limit = 0;
};

Result<Prescribed> prescribed(const CaseSettings& settings, std::string_view name, AxialModel model) {
  CaseEntry entry(settings.file, name, settings.long_form);
  Prescribed out;
  out.scene = entry.scene(model);
  out.limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();
  ASSIGN_OR_RETURN(auto motion, motionOf(settings, name));
  out.motion = std::move(motion);
  return out;
}

}  // namespace

Result<CaseOutcome> tiltPump(const CaseSettings& settings, AxialModel model,
                             const ForceSourceFactory& source) {
  ASSIGN_OR_RETURN(auto given, prescribed(settings, "tilt_pump", model));
  ASSIGN_OR_RETURN(const auto run,
                   runMotion(source, given.scene, samplesOf(given.motion), given.motion.rate_hz));
  const PassivityRecord record = observed(run);
  CaseOutcome outcome{rowOf(record), {}};
  outcome.row.energy_J = record.net_J;
  judgeMotion(outcome.row, "net energy given in a cycle tilt, in, upright, out [J]", record.net_J,
              given.limit);
  return outcome;
}

}  // namespace needlelab
