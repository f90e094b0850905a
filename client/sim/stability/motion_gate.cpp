/// Bad samples of a device: jumps, NaN and infinite values, silence. FORCE_MODEL.md, "Gate", defines the
/// force in these cases.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "client/sim/stability/case.h"
#include "client/sim/stability/gated_run.h"
#include "client/sim/stability/motion_cases.h"
#include "client/sim/stability/passivity_gesture.h"
#include "common/base/range.h"

namespace needlelab {
namespace {

constexpr double kGateSpeed_mps = 0.02;
constexpr double kAnyForce_N = 0.01;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct GateEntry {
  SceneSpec scene;
  double depth_m = 0, limit = 0;
};
Result<GateEntry> gateEntry(const CaseSettings& settings, std::string_view name, AxialModel model) {
  CaseEntry entry(settings.file, name, settings.long_form);
  GateEntry out{entry.scene(model), entry.number("depth_m", 0.0005, 0.05), entry.number("limit", 0)};
  if (!entry.status().ok()) return entry.status().error();
  return out;
}

// The gate bridges a short disturbance. A long one ends in FAULT until the tip is out and a person has
// acknowledged it; then the force returns.
struct Disturbance {
  std::function<void(DeviceSample&, std::size_t)> change;
  double short_s = 0.003, long_s = 0.2;
  std::size_t held_ticks = 5, slack_ticks = 0;
  Fault fault = Fault::kSampleNotFinite;
};

struct Outcome {
  CaseRow row;
  double violation_N = 0;
};

Result<Outcome> disturbed(const GateEntry& entry, const ForceSourceFactory& source, const Disturbance& by,
                          Gate gate) {
  DeviceScript script;
  script.rest(0.3).goTo(entry.depth_m, kGateSpeed_mps).rest(0.02);
  const std::size_t glitch = script.ticks();
  script.with(by.short_s, by.change);
  const std::size_t after_glitch = script.ticks();
  script.rest(0.02);
  FaultTimeline timeline;
  timeline.from = script.ticks();
  timeline.held_ticks = by.held_ticks;
  timeline.slack_ticks = by.slack_ticks;
  timeline.fault = by.fault;
  // acknowledged inside: the tip must have been outside as well
  script.with(by.long_s, by.change).rest(0.05).acknowledge().rest(0.05).goTo(-0.005, kGateSpeed_mps);
  script.rest(0.3).goTo(entry.depth_m, kGateSpeed_mps).rest(0.01);
  const std::size_t again = script.ticks() - 1;
  script.goTo(-0.005, kGateSpeed_mps);

  ASSIGN_OR_RETURN(const auto ticks, runGated(source, entry.scene, script.samples(), DeviceScript::kRate_hz,
                                              gate == Gate::kPresent));
  for (timeline.restart = timeline.from + 1;
       timeline.restart < ticks.size() &&
       !(ticks[timeline.restart].sample.fresh && ticks[timeline.restart].depth_m <= 0 &&
         isFinite(ticks[timeline.restart].sample.tip.p_WT_m));)
    ++timeline.restart;

  Outcome outcome{rowOf(ticks), violationOf(ticks, timeline, gate == Gate::kPresent)};
  const Vec3 held = ticks[glitch - 1].out_W.force_N;
  for (std::size_t k = glitch; k < after_glitch; ++k)
    outcome.violation_N = std::max(outcome.violation_N, norm(ticks[k].out_W.force_N - held));
  for (std::size_t k = glitch; k < timeline.from; ++k)
    if (ticks[k].fault != Fault::kNone) outcome.violation_N = std::numeric_limits<double>::infinity();
  // a force that never returns would meet any timeline
  if (norm(ticks[again].out_W.force_N) < 0.5 * norm(held) || !(norm(held) > kAnyForce_N))
    outcome.violation_N = std::numeric_limits<double>::infinity();
  return outcome;
}

constexpr const char* kQuantity = "greatest departure from the timeline of §3.7 [N]";

Result<CaseOutcome> disturbances(const CaseSettings& settings, std::string_view name, AxialModel model,
                                 const ForceSourceFactory& source, Gate gate,
                                 const std::vector<Disturbance>& all) {
  ASSIGN_OR_RETURN(const auto entry, gateEntry(settings, name, model));
  CaseOutcome outcome;
  outcome.row.finite = true;
  double violation = 0;
  for (const Disturbance& one : all) {
    ASSIGN_OR_RETURN(const auto ran, disturbed(entry, source, one, gate));
    worsen(outcome.row, ran.row);
    violation = std::max(violation, ran.violation_N);
  }
  judgeMotion(outcome.row, kQuantity, violation, entry.limit);
  return outcome;
}

}  // namespace

Result<CaseOutcome> startsInside(const CaseSettings& settings, AxialModel model,
                                 const ForceSourceFactory& source) {
  CaseEntry entry(settings.file, "starts_inside", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const TimedPlan path = entry.path();
  const double rate = entry.number("rate_hz", 50, 40'000), limit = entry.number("limit", 0);
  if (!entry.status().ok()) return entry.status().error();
  ASSIGN_OR_RETURN(const auto run, runMotion(source, scene, samplesOf(path.plan, rate), rate));
  CaseOutcome outcome{rowOf(observed(run)), {forceTrace(run, std::string(axialModelName(model)))}};
  bool outside = false;
  double before = 0, after = 0;
  for (const MotionTick& tick : run.ticks) {
    outside = outside || tick.report.depth_m <= 0;
    double& seen = outside ? after : before;
    seen = std::max(seen, norm(tick.report.wrench_W.force_N));
  }
  judgeMotion(outcome.row, "greatest force before the tip was outside [N]", before, limit);
  // zero force throughout must not pass either
  if (!(after > kAnyForce_N)) {
    outcome.row.passed = false;
    outcome.row.verdict = Verdict::kChatters;
    outcome.row.note = "no force after the tip was outside";
  }
  return outcome;
}

Result<CaseOutcome> teleport(const CaseSettings& settings, AxialModel model, const ForceSourceFactory& source,
                             Gate gate) {
  Disturbance aside, deeper;
  aside.change = [](DeviceSample& sample, std::size_t) { sample.tip.p_WT_m.x += 0.05; };
  deeper.change = [](DeviceSample& sample, std::size_t) { sample.tip.p_WT_m.z -= 0.05; };
  aside.fault = deeper.fault = Fault::kTipTooFast;
  return disturbances(settings, "teleport", model, source, gate, {aside, deeper});
}

Result<CaseOutcome> notANumber(const CaseSettings& settings, AxialModel model,
                               const ForceSourceFactory& source, Gate gate) {
  std::vector<Disturbance> all(4);
  all[0].change = [](DeviceSample& sample, std::size_t) { sample.tip.p_WT_m.z = kNaN; };
  all[1].change = [](DeviceSample& sample, std::size_t) { sample.tip.p_WT_m.x = HUGE_VAL; };
  all[2].change = [](DeviceSample& sample, std::size_t) { sample.tip.q_WT.w = kNaN; };
  all[3].change = [](DeviceSample& sample, std::size_t) { sample.tip.q_WT = {0, 0, 0, 0}; };
  all[3].fault = Fault::kOrientationInvalid;
  return disturbances(settings, "not_a_number", model, source, gate, all);
}

Result<CaseOutcome> frozenDevice(const CaseSettings& settings, AxialModel model,
                                 const ForceSourceFactory& source, Gate gate) {
  if (!hasStop(model)) {
    CaseOutcome none;
    none.row.note = "has no stop: a hand at rest is pushed on; the gate's part is the same for every model";
    return none;
  }
  // silence: the force is held until the watchdog reacts, then as for any fault
  CaseEntry numbers(settings.file, "frozen_device", settings.long_form);
  Disturbance silence;
  silence.change = [](DeviceSample& sample, std::size_t) { sample.fresh = false; };
  silence.fault = Fault::kDeviceSilent;
  silence.short_s = 0.015;
  silence.held_ticks = 6;
  silence.slack_ticks =
      static_cast<std::size_t>(numbers.number("watchdog_s", 0.01, 2) * DeviceScript::kRate_hz) -
      silence.held_ticks;
  const double rest_s = numbers.number("rest_s", 0.5, 60), rejection_limit = numbers.number("rest_limit", 0);
  if (!numbers.status().ok()) return numbers.status().error();
  auto outcome = disturbances(settings, "frozen_device", model, source, gate, {silence});
  if (!outcome.ok()) return outcome;

  // the same place again and again: a hand at rest
  ASSIGN_OR_RETURN(const auto entry, gateEntry(settings, "frozen_device", model));
  DeviceScript script;
  script.rest(0.3).goTo(entry.depth_m, kGateSpeed_mps).rest(rest_s);
  ASSIGN_OR_RETURN(const auto ticks, runGated(source, entry.scene, script.samples(), DeviceScript::kRate_hz,
                                              gate == Gate::kPresent));
  const double rejection = entry.scene.layers.front().rejection_force_N;
  const double left = std::max(0.0, norm(ticks.back().out_W.force_N) - rejection);
  CaseRow& row = outcome->row;
  if (row.passed) judgeMotion(row, "force after a rest, beyond f_rej [N]", left, rejection_limit);
  row.note = "at rest the force ends " + numberText(roundedTo(left, 3)) + " N above f_rej";
  return outcome;
}

namespace {

constexpr double kFlippedSpeed_mps = 0.02;
constexpr double kTorqueSlew_Nm = 0.1;     // a tick of 1 ms, §3.7
constexpr double kDirectionError = 1e-12;  // §10

Quat reversed(Quat q) {
  return Quat{1, 0, 0, 0} * q;
}
Quat nearlyReversed(Quat q) {
  return normalized(Quat{1, 0, 0, 0.1}) * q;
}
// what nearlyReversed points to, mirrored at the skin
Quat nearlyUpright(Quat q) {
  return normalized(Quat{0.1, 0, 0, 1}) * q;
}
// the same rotation
Quat negative(Quat q) {
  return {-q.x, -q.y, -q.z, -q.w};
}
using Turn = Quat (*)(Quat);

// an insertion; the needle is turned for a while in the tissue, or all the time
std::vector<DeviceSample> insertion(Turn turn, bool always) {
  const auto change = [turn](DeviceSample& sample, std::size_t) { sample.tip.q_WT = turn(sample.tip.q_WT); };
  DeviceScript script;
  script.rest(0.3).goTo(0.015, kFlippedSpeed_mps).rest(0.1);
  always ? script.rest(0.05) : script.with(0.05, change);
  auto samples = script.rest(0.3).goTo(0.02, kFlippedSpeed_mps).goTo(-0.005, kFlippedSpeed_mps).samples();
  for (std::size_t k = 0; always && k < samples.size(); ++k) change(samples[k], k);
  return samples;
}

// The trajectory is fixed at entry, mirrored at the skin for a needle that points out: then the needle's
// orientation does not change the force. Torque builds up slowly.
double departure(const std::vector<GatedTick>& turned, const std::vector<GatedTick>& upright) {
  double worst = 0;
  for (std::size_t k = 1; k < turned.size(); ++k) {
    worst = std::max(worst, norm(turned[k].out_W.force_N - upright[k].out_W.force_N));
    const double step = norm(turned[k].out_W.torque_Nm - turned[k - 1].out_W.torque_Nm);
    worst = std::max(worst, step - kTorqueSlew_Nm);
  }
  return worst;
}

}  // namespace

Result<CaseOutcome> flippedAxis(const CaseSettings& settings, AxialModel model,
                                const ForceSourceFactory& source, Gate gate) {
  CaseEntry entry(settings.file, "flipped_axis", settings.long_form);
  const SceneSpec scene = entry.scene(model);
  const double limit = entry.number("limit", 0);
  // with FEM each random scene is a mesh of its own
  const std::uint64_t fuzzed =
      entry.whole(model == AxialModel::kFem ? "fuzzed_ticks_fem" : "fuzzed_ticks", 1000);
  if (!entry.status().ok()) return entry.status().error();

  CaseOutcome outcome;
  CaseRow& row = outcome.row;
  row.finite = true;
  const bool with_gate = gate == Gate::kPresent;
  const auto run = [&](const std::vector<DeviceSample>& samples) {
    return runGated(source, scene, samples, DeviceScript::kRate_hz, with_gate);
  };
  double worst = 0;
  ASSIGN_OR_RETURN(const auto upright, run(insertion([](Quat q) { return q; }, true)));
  ASSIGN_OR_RETURN(const auto nearly_upright, run(insertion(nearlyUpright, true)));
  for (const Turn turn : {&reversed, &nearlyReversed, &negative})
    for (const bool always : {false, true}) {
      ASSIGN_OR_RETURN(const auto turned, run(insertion(turn, always)));
      worsen(row, rowOf(turned));
      worst =
          std::max(worst, departure(turned, always && turn == &nearlyReversed ? nearly_upright : upright));
    }

  ASSIGN_OR_RETURN(const auto fuzz, fuzzSource(source, model, fuzzed, with_gate));
  row.finite = row.finite && fuzz.finite;
  row.max_force_N = std::max(*row.max_force_N, fuzz.max_force_N);
  worst = std::max({worst, fuzz.excess_force_N, fuzz.excess_rendered_N});
  judgeMotion(row, "greatest departure from what is allowed [N, N·m]", worst, limit);
  if (row.passed && fuzz.direction_error > kDirectionError) {
    row.passed = false;
    row.verdict = Verdict::kChatters;
  }
  row.note = fmt::format("{} fuzzed ticks, |u| within {} of 1", fuzz.ticks,
                         numberText(roundedTo(fuzz.direction_error, 2)));
  return outcome;
}

}  // namespace needlelab
