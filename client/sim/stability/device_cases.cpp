/// What a device or its clock does wrong without the gate's seeing it: a jump just under its limit, an axis
/// that stands still, the other quaternion of the same rotation; and a clock that steps, which the gate must
/// bridge.

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "client/sim/stability/case.h"
#include "client/sim/stability/gated_run.h"
#include "client/sim/stability/motion_cases.h"
#include "client/sim/tools/hand_thresholds.h"
#include "common/base/range.h"
#include "common/haptics/tool_transform.h"

namespace needlelab {
namespace {

// a case of the gate: as shipped, with it
template <auto Run>
Result<CaseOutcome> withGate(const CaseSettings& settings, AxialModel model,
                             const ForceSourceFactory& source) {
  return Run(settings, model, source, Gate::kPresent);
}

}  // namespace

std::vector<StabilityCase> deviceCases() {
  return {
      {"glitch_under_gate", "for one tick the tip is 4.9 mm elsewhere: 5 mm is too much for the gate", true,
       true, withGate<glitchUnderGate>},
      {"frozen_axis", "one axis stands still for 0.4 s while the others go on", true, true,
       withGate<frozenAxis>},
      {"quaternion_sign", "the device reports q and −q, which are the same rotation", true, true,
       quaternionSign},
      {"clock_steps", "the loop's clock steps forward, or back", true, true, withGate<clockSteps>},
  };
}

namespace {

constexpr double kScriptRate_hz = DeviceScript::kRate_hz;

struct DisturbedRuns {
  double departure_N = 0;      ///< greatest, from the run without the disturbance
  std::size_t felt_ticks = 0;  ///< the longest that one was noticeable
  bool fault = false;
};

// both runs have as many ticks
void compare(const std::vector<GatedTick>& disturbed, const std::vector<GatedTick>& sound, std::size_t from,
             DisturbedRuns& worst) {
  std::size_t felt = 0;
  for (std::size_t k = from; k < disturbed.size(); ++k) {
    const double departure_N = norm(disturbed[k].out_W.force_N - sound[k].out_W.force_N);
    worst.departure_N = std::max(worst.departure_N, departure_N);
    felt += departure_N > kNoticeableStep_N ? 1 : 0;
    worst.fault = worst.fault || disturbed[k].fault != Fault::kNone;
  }
  worst.felt_ticks = std::max(worst.felt_ticks, felt);
}

}  // namespace

// The engine takes the place for true: the wall follows it, and stays where the glitch took it. So the force
// departs by what tissue can do at most, f_cut + f_att, until the needle has caught up with the wall.
Result<CaseOutcome> glitchUnderGate(const CaseSettings& settings, AxialModel model,
                                    const ForceSourceFactory& source, Gate gate) {
  CaseEntry entry(settings.file, "glitch_under_gate", settings.long_form);
  const SceneSpec wall = entry.scene(), scene = entry.scene(model);
  const double glitch_m = entry.number("glitch_m", 0, 0.05), speed = entry.number("speed_m_s", 1e-3, 1),
               depth_m = entry.number("depth_m", 0.005, 0.04), rest_s = entry.number("rest_s", 0.1, 10);
  if (!entry.status().ok()) return entry.status().error();

  DeviceScript script;
  std::vector<std::size_t> ticks;  // on the way in, at rest, on the way out
  script.rest(0.3).goTo(depth_m, speed);
  ticks.push_back(script.ticks());
  script.goTo(depth_m + 0.005, speed).rest(rest_s);
  ticks.push_back(script.ticks());
  script.rest(0.2).goTo(depth_m, speed);
  ticks.push_back(script.ticks());
  script.goTo(-0.005, speed);
  const auto run = [&](const std::vector<DeviceSample>& samples) {
    return runGated(source, scene, samples, kScriptRate_hz, gate == Gate::kPresent);
  };
  ASSIGN_OR_RETURN(const auto sound, run(script.samples()));

  CaseOutcome outcome{rowOf(sound)};
  DisturbedRuns worst;
  for (const std::size_t tick : ticks)
    for (const Vec3 aside : {Vec3{0, 0, -glitch_m}, Vec3{0, 0, glitch_m}, Vec3{glitch_m, 0, 0}}) {
      auto samples = script.samples();
      samples[tick].tip.p_WT_m += aside;
      ASSIGN_OR_RETURN(const auto disturbed, run(samples));
      worsen(outcome.row, rowOf(disturbed));
      compare(disturbed, sound, tick, worst);
    }
  const LayerSpec& layer = wall.layers.front();
  judgeMotion(outcome.row, "greatest departure from the run without it [N]",
              worst.fault ? HUGE_VAL : worst.departure_N, layer.cutting_force_N + layer.attracted_force_N);
  outcome.row.note =
      fmt::format("noticeable for up to {:.2g} s", static_cast<double>(worst.felt_ticks) / kScriptRate_hz);
  return outcome;
}

namespace {

constexpr double kGateWait_s = 0.02;  // for which the gate may hold the force after a jump

// in, aside and deeper, back, out; the strokes within which an axis freezes
struct AsidePlan {
  HandPlan plan{Pose{}};
  std::array<double, 2> stroke_s{};
};
AsidePlan asidePlan(double depth_m, double aside_m, double deeper_m, double speed_mps) {
  const Quat down = orientationAlong(kInward_W);
  const auto at = [&](double x, double depth) { return Pose{{x, 0, -depth}, down}; };
  AsidePlan of;
  of.plan = HandPlan(at(0, -0.005));
  of.plan.hold(0.3).moveTo(at(0, depth_m), speed_mps, Motion::kLinear);
  of.stroke_s[0] = of.plan.duration_s();
  of.plan.moveTo(at(aside_m, depth_m + deeper_m), speed_mps, Motion::kLinear).hold(0.3);
  of.stroke_s[1] = of.plan.duration_s();
  of.plan.moveTo(at(0, depth_m), speed_mps, Motion::kLinear)
      .moveTo(at(0, -0.005), speed_mps, Motion::kLinear);
  return of;
}

std::vector<DeviceSample> deviceSamples(const HandPlan& plan) {
  std::vector<DeviceSample> samples;
  for (const TipSample& tip : samplesOf(plan, kScriptRate_hz)) {
    samples.emplace_back();
    samples.back().tip = tip;
  }
  return samples;
}

}  // namespace

// The force is that of the place that the device reports. When the axis goes on again, the place jumps, the
// gate bridges the jump, and the force must be that of a device that never froze: along the needle it has no
// memory of the way; the fixture's dead radius has one, worth k·|e| at most.
Result<CaseOutcome> frozenAxis(const CaseSettings& settings, AxialModel model,
                               const ForceSourceFactory& source, Gate gate) {
  CaseEntry entry(settings.file, "frozen_axis", settings.long_form);
  const SceneSpec wall = entry.scene(), scene = entry.scene(model);
  const double depth_m = entry.number("depth_m", 0.001, 0.03), aside_m = entry.number("aside_m", 0, 0.02),
               deeper_m = entry.number("deeper_m", 0.001, 0.03), speed = entry.number("speed_m_s", 1e-3, 0.1),
               frozen_s = entry.number("frozen_s", 0.01, 1), limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();
  const AsidePlan plan = asidePlan(depth_m, aside_m, deeper_m, speed);
  const auto truth = deviceSamples(plan.plan);
  const auto run = [&](const std::vector<DeviceSample>& samples) {
    return runGated(source, scene, samples, kScriptRate_hz, gate == Gate::kPresent);
  };
  ASSIGN_OR_RETURN(const auto sound, run(truth));

  CaseOutcome outcome{rowOf(sound)};
  double departure_N = 0, given_J = 0;
  bool fault = false;
  for (double Vec3::*axis : {&Vec3::x, &Vec3::y, &Vec3::z})
    for (const double stroke_s : plan.stroke_s) {
      const auto from = static_cast<std::size_t>(stroke_s * kScriptRate_hz + 0.5);
      const auto to = from + static_cast<std::size_t>(frozen_s * kScriptRate_hz + 0.5);
      auto samples = truth;
      for (std::size_t k = from; k < to; ++k) samples[k].tip.p_WT_m.*axis = truth[from].tip.p_WT_m.*axis;
      ASSIGN_OR_RETURN(const auto frozen, run(samples));
      worsen(outcome.row, rowOf(frozen));
      double work_J = 0;
      for (std::size_t k = from; k < to; ++k) {
        work_J += dot(frozen[k - 1].out_W.force_N, truth[k].tip.p_WT_m - truth[k - 1].tip.p_WT_m);
        given_J = std::max(given_J, work_J);
      }
      for (std::size_t k = to; k < frozen.size(); ++k) {
        fault = fault || frozen[k].fault != Fault::kNone;
        if (k < to + static_cast<std::size_t>(kGateWait_s * kScriptRate_hz)) continue;
        // the needle stands upright: the fixture's force lies across W's z
        const Vec3 by_N = frozen[k].out_W.force_N - sound[k].out_W.force_N;
        const StepReport& at = sound[k].report;
        const double radius_N = at.clamping_stiffness_N_per_m * at.lateral_error_m;
        departure_N = std::max({departure_N, std::abs(by_N.z), norm({by_N.x, by_N.y, 0}) - radius_N});
      }
    }
  outcome.row.energy_J = given_J;
  judgeMotion(outcome.row, "departure, 20 ms after the axis froze [N]", fault ? HUGE_VAL : departure_N,
              limit);
  // while an axis stands still the force does not know of the hand's way: no more than the tissue's own force
  // over it
  const LayerSpec& layer = wall.layers.front();
  const double most_J = (layer.cutting_force_N + layer.attracted_force_N) * speed * frozen_s;
  if (given_J > most_J) {
    if (outcome.row.passed) outcome.row.verdict = Verdict::kChatters;
    outcome.row.passed = false;
  }
  outcome.row.note =
      fmt::format("a frozen axis gives the hand {:.2g} mJ, {:.2g} mJ passes", 1e3 * given_J, 1e3 * most_J);
  return outcome;
}

namespace {

// the handle behind the gate, with a tool: as HapticChain
Result<std::vector<Wrench>> runAtHandle(const ForceSourceFactory& make_source, const SceneSpec& scene,
                                        const std::vector<Pose>& handles, const Pose& X_HT, double rate_hz) {
  ASSIGN_OR_RETURN(auto source, make_source(scene, rate_hz));
  ForceGate gate(DeviceLimits{}, rate_hz);
  std::vector<Wrench> at_handle;
  at_handle.reserve(handles.size());
  StepReport report;
  for (const Pose& X_WH : handles) {
    const Pose X_WT = tipFromHandle(X_WH, X_HT);
    Wrench wanted;
    if (gate.admit({X_WT.p, X_WT.q}, true, 0.0)) {
      source->step({X_WT.p, normalized(X_WT.q)}, report);
      wanted = wrenchAtHandle(report.wrench_W, X_WT.p, X_WH.p);
    }
    gate.noteOutside(report.depth_m <= 0);
    at_handle.push_back(gate.guard(wanted).wrench());
  }
  return at_handle;
}

Quat otherSign(Quat q) {
  return {-q.x, -q.y, -q.z, -q.w};
}

}  // namespace

// q and −q are one rotation, and every product of the tool's transform takes either: the same force and
// torque to the last bit, however often the sign changes
Result<CaseOutcome> quaternionSign(const CaseSettings& settings, AxialModel model,
                                   const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "quaternion_sign", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const Pose X_HT = entry.plant().device.X_HT;
  const double limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();
  ASSIGN_OR_RETURN(const auto motion, motionOf(settings, "quaternion_sign"));
  std::vector<Pose> handles;
  for (const TipSample& tip : samplesOf(motion))
    handles.push_back(Pose{tip.p_WT_m, tip.q_WT} * inverse(X_HT));
  const auto run = [&](const std::vector<Pose>& poses) {
    return runAtHandle(source, scene, poses, X_HT, motion.rate_hz);
  };
  ASSIGN_OR_RETURN(const auto sound, run(handles));

  CaseOutcome outcome;
  CaseRow& row = outcome.row;
  row.finite = true;
  row.max_force_N = 0;
  double departure = 0, torque_Nm = 0;
  // every second tick, and once, in the middle
  for (const bool always : {true, false}) {
    auto poses = handles;
    for (std::size_t k = 0; k < poses.size(); ++k)
      if (always ? k % 2 == 1 : k > poses.size() / 2) poses[k].q = otherSign(poses[k].q);
    ASSIGN_OR_RETURN(const auto turned, run(poses));
    for (std::size_t k = 0; k < turned.size(); ++k) {
      row.finite = row.finite && isFinite(turned[k].force_N) && isFinite(turned[k].torque_Nm);
      row.max_force_N = std::max(*row.max_force_N, norm(turned[k].force_N));
      torque_Nm = std::max(torque_Nm, norm(sound[k].torque_Nm));
      departure = std::max({departure, norm(turned[k].force_N - sound[k].force_N),
                            norm(turned[k].torque_Nm - sound[k].torque_Nm)});
    }
  }
  judgeMotion(row, "greatest departure from the run with one sign [N, N·m]", departure, limit);
  // a run without torque shows nothing of a torque's sign
  if (!(torque_Nm > 0)) row.passed = false;
  row.note = fmt::format("torque at the handle up to {:.2g} N·m", torque_Nm);
  return outcome;
}

namespace {

constexpr std::int64_t kWatchdogTicks = 20, kFallTicks = 20, kRiseTicks = 200;

// FORCE_MODEL.md, "Gate", for a loop that stood still: up to the watchdog's limit nothing; beyond it the
// share of the force falls within 20 ms and rises within 200 ms
double shareAfter(std::int64_t stood_still, std::size_t ticks_since) {
  if (stood_still <= kWatchdogTicks) return 1;
  const auto since = static_cast<std::int64_t>(ticks_since) + 1;
  if (since <= kFallTicks) return 1 - static_cast<double>(since) / kFallTicks;
  return std::min(1.0, static_cast<double>(since - kFallTicks) / kRiseTicks);
}

}  // namespace

// Forward, the loop takes the ticks for missed and fades in again; the needle has not moved meanwhile. Back,
// the loop waits until its clock has come there again and notices nothing: the needle has gone on, and the
// device renders the last force. (The machine's clock of the loop, CLOCK_MONOTONIC, does neither; a virtual
// machine that stood still does the first.)
Result<CaseOutcome> clockSteps(const CaseSettings& settings, AxialModel model,
                               const ForceSourceFactory& source, Gate gate) {
  CaseEntry entry(settings.file, "clock_steps", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const double depth_m = entry.number("depth_m", 0.0005, 0.03), speed = entry.number("speed_m_s", 1e-3, 0.1),
               beyond_m = entry.number("beyond_m", 0.0005, 0.03), limit = entry.number("limit", 0);
  const std::vector<double> forward = entry.numbers("forward_ticks"), back = entry.numbers("back_ticks");
  if (!entry.status().ok()) return entry.status().error();

  DeviceScript script;
  script.rest(0.3).goTo(depth_m, speed);
  const std::size_t at = script.ticks();
  script.goTo(depth_m + beyond_m, speed).goTo(-0.005, 0.02);
  CaseOutcome outcome;
  CaseRow& row = outcome.row;
  row.finite = true;
  double departure_N = 0;
  const auto judged = [&](const std::vector<DeviceSample>& samples, std::int64_t stood_still) -> Status {
    auto ran = runGated(source, scene, samples, kScriptRate_hz, gate == Gate::kPresent);
    if (!ran.ok()) return ran.error();
    worsen(row, rowOf(*ran));
    for (std::size_t k = at; k < ran->size(); ++k) {
      const Vec3 wanted_N = (*ran)[k].report.wrench_W.force_N * shareAfter(stood_still, k - at);
      departure_N = std::max(departure_N, norm((*ran)[k].out_W.force_N - wanted_N));
      if ((*ran)[k].fault != Fault::kNone) departure_N = HUGE_VAL;
    }
    return {};
  };
  for (const double ticks : forward) {
    auto samples = script.samples();
    samples[at].elapsed_ticks = static_cast<std::int64_t>(ticks) + 1;
    RETURN_IF_ERROR(judged(samples, static_cast<std::int64_t>(ticks)));
  }
  for (const double ticks : back) {
    auto samples = script.samples();
    const auto from = samples.begin() + static_cast<std::ptrdiff_t>(at);
    const auto lost = std::min<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(ticks), samples.end() - from);
    samples.erase(from, from + lost);
    RETURN_IF_ERROR(judged(samples, 0));
  }
  judgeMotion(row, "greatest departure from the share that the gate gives [N]", departure_N, limit);
  return outcome;
}

}  // namespace needlelab
