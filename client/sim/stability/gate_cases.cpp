/// Bad samples of a device: jumps, NaN and infinite values, silence, a needle that points out.
/// FORCE_MODEL.md, "Gate", defines the force in these cases.

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "client/sim/stability/case.h"
#include "common/base/range.h"

namespace needlelab {
namespace {

constexpr double kGateSpeed_mps = 0.02;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// The gate bridges a short disturbance. A long one ends in FAULT until the tip is out and a person has
// acknowledged it; then the force returns.
struct Disturbance {
  std::function<void(DeviceSample&, std::size_t)> change;
  double short_s = 0.003, long_s = 0.2;
  std::size_t held_ticks = 5, slack_ticks = 0;
  Fault fault = Fault::kSampleNotFinite;
};

// the greatest departure from what the gate allows
Result<double> disturbed(Trial& t, double depth_m, const Disturbance& by) {
  DeviceScript script;
  script.rest(0.3).goTo(depth_m, kGateSpeed_mps).rest(0.02);
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
  script.rest(0.3).goTo(depth_m, kGateSpeed_mps).rest(0.01);
  const std::size_t again = script.ticks() - 1;
  script.goTo(-0.005, kGateSpeed_mps);

  ASSIGN_OR_RETURN(const auto ticks, t.gated(script.samples()));
  for (timeline.restart = timeline.from + 1;
       timeline.restart < ticks.size() &&
       !(ticks[timeline.restart].sample.fresh && ticks[timeline.restart].depth_m <= 0 &&
         isFinite(ticks[timeline.restart].sample.tip.p_WT_m));)
    ++timeline.restart;

  double violation_N = violationOf(ticks, timeline, t.settings.control.gate);
  const Vec3 held = ticks[glitch - 1].out_W.force_N;
  for (std::size_t k = glitch; k < after_glitch; ++k)
    violation_N = std::max(violation_N, norm(ticks[k].out_W.force_N - held));
  for (std::size_t k = glitch; k < timeline.from; ++k)
    if (ticks[k].fault != Fault::kNone) violation_N = HUGE_VAL;
  // a force that never returns would meet any timeline
  if (norm(ticks[again].out_W.force_N) < 0.5 * norm(held) || !(norm(held) > kAnyForce_N))
    violation_N = HUGE_VAL;
  return violation_N;
}

// the tip goes in, and the samples are disturbed there
Status disturbances(Trial& t, const std::vector<Disturbance>& all) {
  const double depth_m = t.number("depth_m", 0.0005, 0.05), limit = t.number("limit", 0);
  double violation_N = 0;
  for (const Disturbance& one : all) {
    ASSIGN_OR_RETURN(const double most_N, disturbed(t, depth_m, one));
    violation_N = std::max(violation_N, most_N);
  }
  t.judge("greatest departure from the timeline of §3.7 [N]", violation_N, limit);
  return {};
}

Status teleport(Trial& t) {
  Disturbance aside, deeper;
  aside.change = [](DeviceSample& sample, std::size_t) { sample.tip.p_WT_m.x += 0.05; };
  deeper.change = [](DeviceSample& sample, std::size_t) { sample.tip.p_WT_m.z -= 0.05; };
  aside.fault = deeper.fault = Fault::kTipTooFast;
  return disturbances(t, {aside, deeper});
}

Status notANumber(Trial& t) {
  std::vector<Disturbance> all(4);
  all[0].change = [](DeviceSample& sample, std::size_t) { sample.tip.p_WT_m.z = kNaN; };
  all[1].change = [](DeviceSample& sample, std::size_t) { sample.tip.p_WT_m.x = HUGE_VAL; };
  all[2].change = [](DeviceSample& sample, std::size_t) { sample.tip.q_WT.w = kNaN; };
  all[3].change = [](DeviceSample& sample, std::size_t) { sample.tip.q_WT = {0, 0, 0, 0}; };
  all[3].fault = Fault::kOrientationInvalid;
  return disturbances(t, all);
}

Status frozenDevice(Trial& t) {
  if (!t.hasStop())
    return t.saysNothing(
        "has no stop: a hand at rest is pushed on; the gate's part is the same for every model");
  // silence: the force is held until the watchdog reacts, then as for any fault
  Disturbance silence;
  silence.change = [](DeviceSample& sample, std::size_t) { sample.fresh = false; };
  silence.fault = Fault::kDeviceSilent;
  silence.short_s = 0.015;
  silence.held_ticks = 6;
  silence.slack_ticks =
      static_cast<std::size_t>(t.number("watchdog_s", 0.01, 2) * DeviceScript::kRate_hz) - silence.held_ticks;
  const double rest_s = t.number("rest_s", 0.5, 60), rejection_limit = t.number("rest_limit", 0);
  RETURN_IF_ERROR(disturbances(t, {silence}));

  // the same place again and again: a hand at rest
  DeviceScript script;
  script.rest(0.3).goTo(t.number("depth_m", 0.0005, 0.05), kGateSpeed_mps).rest(rest_s);
  ASSIGN_OR_RETURN(const auto ticks, t.gated(script.samples(), false));
  const double rejection = t.scene.layers.front().rejection_force_N;
  const double left = std::max(0.0, norm(ticks.back().out_W.force_N) - rejection);
  if (t.row().passed) t.judge("force after a rest, beyond f_rej [N]", left, rejection_limit);
  t.row().note = "at rest the force ends " + numberText(roundedTo(left, 3)) + " N above f_rej";
  return {};
}

constexpr double kFlippedSpeed_mps = 0.02;
constexpr double kTorqueSlew_Nm = 0.1;     // a tick of 1 ms, §3.7
constexpr double kDirectionError = 1e-12;  // §10

using Turn = Quat (*)(Quat);
constexpr Turn kReversed = [](Quat q) { return Quat{1, 0, 0, 0} * q; };
constexpr Turn kNearlyReversed = [](Quat q) { return normalized(Quat{1, 0, 0, 0.1}) * q; };
// what kNearlyReversed points to, mirrored at the skin
constexpr Turn kNearlyUpright = [](Quat q) { return normalized(Quat{0.1, 0, 0, 1}) * q; };

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

Status flippedAxis(Trial& t) {
  // with FEM each random scene is a mesh of its own
  const std::uint64_t fuzzed =
      t.whole(t.model == AxialModel::kFem ? "fuzzed_ticks_fem" : "fuzzed_ticks", 1000);
  double worst = 0;
  ASSIGN_OR_RETURN(const auto upright, t.gated(insertion([](Quat q) { return q; }, true), false));
  ASSIGN_OR_RETURN(const auto nearly_upright, t.gated(insertion(kNearlyUpright, true), false));
  for (const Turn turn : {kReversed, kNearlyReversed, Turn{otherSign}})
    for (const bool always : {false, true}) {
      ASSIGN_OR_RETURN(const auto turned, t.gated(insertion(turn, always)));
      worst =
          std::max(worst, departure(turned, always && turn == kNearlyReversed ? nearly_upright : upright));
    }

  ASSIGN_OR_RETURN(const auto fuzz, fuzzSource(t.source, t.model, fuzzed, t.settings.control.gate));
  CaseRow& row = t.row();
  row.finite = row.finite && fuzz.finite;
  row.max_force_N = std::max(*row.max_force_N, fuzz.max_force_N);
  worst = std::max({worst, fuzz.excess_force_N, fuzz.excess_rendered_N});
  t.judge("greatest departure from what is allowed [N, N·m]", worst, t.number("limit", 0),
          fmt::format("{} fuzzed ticks, |u| within {} of 1", fuzz.ticks,
                      numberText(roundedTo(fuzz.direction_error, 2))));
  t.require(fuzz.direction_error <= kDirectionError);
  return {};
}

}  // namespace

std::vector<StabilityCase> gateCases() {
  return {
      {"teleport", teleport},
      {"not_a_number", notANumber},
      {"frozen_device", frozenDevice},
      {"flipped_axis", flippedAxis},
  };
}

}  // namespace needlelab
