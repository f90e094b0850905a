/// Bad samples from a device: jumps, NaN and infinite values, silence, a needle that points outward.
/// FORCE_MODEL.md, "Gate", defines the force in these cases.

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "client/device/hand/hand.h"
#include "client/sim/stability/case.h"
#include "common/base/range.h"
#include "common/haptics/models/like_for_like.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

constexpr double kGateSpeed_mps = 0.02;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// The gate bridges a short disturbance. A long one ends in FAULT until the tip is outside and a person has
// acknowledged it; then the force returns.
struct Disturbance {
  std::function<void(DeviceSample&, std::size_t)> change;
  double short_s = 0.003, long_s = 0.2;
  std::size_t held_ticks = 5, slack_ticks = 0;  // ticks for which the force is held, and by which the fault
                                                // may be late
  Fault fault = Fault::kSampleNotFinite;
};

// Checks what FORCE_MODEL.md, "Gate", allows after the samples turn bad at tick `from`: the last force is
// held, then the fault comes, and the force is zero within 20 ticks, until the tip is outside and the fault
// was acknowledged at `restart`. Returns the largest violation in N; infinite if the fault is missing or
// different, or a force is not finite. A run without a gate (a control) never raises the fault: only its
// forces are judged, as if the fault had come at the last allowed tick.
double violationOf(const std::vector<GatedTick>& ticks, std::size_t from, std::size_t restart,
                   const Disturbance& by, bool with_gate) {
  constexpr std::size_t kFadeTicks = 20;
  const auto force = [&](std::size_t k) { return ticks[k].out_W.force_N; };
  for (const GatedTick& tick : ticks)
    if (!isFinite(tick.out_W.force_N) || !isFinite(tick.out_W.torque_Nm)) return HUGE_VAL;

  std::size_t fault = with_gate ? from : from + by.held_ticks + by.slack_ticks;
  while (with_gate && fault < ticks.size() && ticks[fault].fault == Fault::kNone) ++fault;
  if (fault >= ticks.size() || (with_gate && ticks[fault].fault != by.fault)) return HUGE_VAL;
  if (fault < from + by.held_ticks || fault > from + by.held_ticks + by.slack_ticks) return HUGE_VAL;

  double violation = 0;
  const Vec3 last = force(from - 1);
  for (std::size_t k = from; k < fault; ++k) violation = std::max(violation, norm(force(k) - last));
  for (std::size_t k = fault; k < std::min(restart, ticks.size()); ++k) {
    violation = std::max(violation, norm(force(k)) - norm(force(k - 1)));  // must never increase
    if (k >= fault + kFadeTicks) violation = std::max(violation, norm(force(k)));
  }
  return violation;
}

// Returns the largest deviation from what the gate allows.
Result<double> disturbed(Trial& t, double depth_m, const Disturbance& by) {
  DeviceScript script;
  script.rest(0.3).goTo(depth_m, kGateSpeed_mps).rest(0.02);
  const std::size_t glitch = script.ticks();
  script.with(by.short_s, by.change);
  const std::size_t after_glitch = script.ticks();
  script.rest(0.02);
  const std::size_t from = script.ticks();
  // acknowledged inside: the tip must have been outside too
  script.with(by.long_s, by.change).rest(0.05).acknowledge().rest(0.05).goTo(-0.005, kGateSpeed_mps);
  script.rest(0.3).goTo(depth_m, kGateSpeed_mps).rest(0.01);
  const std::size_t again = script.ticks() - 1;
  script.goTo(-0.005, kGateSpeed_mps);

  ASSIGN_OR_RETURN(const auto ticks, t.gated(script.samples()));
  std::size_t restart = from + 1;
  while (restart < ticks.size() && !(ticks[restart].sample.fresh && ticks[restart].depth_m <= 0 &&
                                     isFinite(ticks[restart].sample.tip.p_WT_m)))
    ++restart;

  double violation_N = violationOf(ticks, from, restart, by, t.settings.control.gate);
  const Vec3 held = ticks[glitch - 1].out_W.force_N;
  for (std::size_t k = glitch; k < after_glitch; ++k)
    violation_N = std::max(violation_N, norm(ticks[k].out_W.force_N - held));
  for (std::size_t k = glitch; k < from; ++k)
    if (ticks[k].fault != Fault::kNone) violation_N = HUGE_VAL;
  // a force that never returns would satisfy any timeline
  if (norm(ticks[again].out_W.force_N) < 0.5 * norm(held) || !(norm(held) > kAnyForce_N))
    violation_N = HUGE_VAL;
  return violation_N;
}

// The tip goes in, and the samples are disturbed there.
Status disturbances(Trial& t, const std::vector<Disturbance>& all) {
  const double depth_m = t.number("depth_m", 0.0005, 0.05), limit = t.number("limit", 0);
  double violation_N = 0;
  for (const Disturbance& one : all) {
    ASSIGN_OR_RETURN(const double max_N, disturbed(t, depth_m, one));
    violation_N = std::max(violation_N, max_N);
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
    return t.notApplicable(
        "has no stop: a hand at rest is pushed on; the gate's part is the same for every model");
  // silence: the force is held until the watchdog reacts, then as for any fault
  Disturbance silence;
  silence.change = [](DeviceSample& sample, std::size_t) { sample.fresh = false; };
  silence.fault = Fault::kDeviceSilent;
  silence.short_s = 0.015;
  silence.held_ticks = 6;
  silence.slack_ticks =
      static_cast<std::size_t>(t.number("watchdog_s", 0.01, 2) * kMotionRate_hz) - silence.held_ticks;
  const double rest_s = t.number("rest_s", 0.5, 60), rejection_limit = t.number("rest_limit", 0);
  RETURN_IF_ERROR(disturbances(t, {silence}));

  // the same position again and again: a hand at rest
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
constexpr double kTorqueSlew_Nm = 0.1;     // per tick of 1 ms, §3.7
constexpr double kDirectionError = 1e-12;  // §10

using Turn = Quat (*)(Quat);
constexpr Turn kReversed = [](Quat q) { return Quat{1, 0, 0, 0} * q; };
constexpr Turn kNearlyReversed = [](Quat q) { return normalized(Quat{1, 0, 0, 0.1}) * q; };
// the direction of kNearlyReversed, mirrored at the skin
constexpr Turn kNearlyUpright = [](Quat q) { return normalized(Quat{0.1, 0, 0, 1}) * q; };

// An insertion with the needle turned for a while in the tissue, or all the time.
std::vector<DeviceSample> insertion(Turn turn, bool always) {
  const auto change = [turn](DeviceSample& sample, std::size_t) { sample.tip.q_WT = turn(sample.tip.q_WT); };
  DeviceScript script;
  script.rest(0.3).goTo(0.015, kFlippedSpeed_mps).rest(0.1);
  always ? script.rest(0.05) : script.with(0.05, change);
  auto samples = script.rest(0.3).goTo(0.02, kFlippedSpeed_mps).goTo(-0.005, kFlippedSpeed_mps).samples();
  for (std::size_t k = 0; always && k < samples.size(); ++k) change(samples[k], k);
  return samples;
}

// The trajectory is fixed at entry, mirrored at the skin for a needle that points outward; after that the
// needle's orientation does not affect the force. Torque builds up slowly.
double departure(const std::vector<GatedTick>& turned, const std::vector<GatedTick>& upright) {
  double worst = 0;
  for (std::size_t k = 1; k < turned.size(); ++k) {
    worst = std::max(worst, norm(turned[k].out_W.force_N - upright[k].out_W.force_N));
    const double step = norm(turned[k].out_W.torque_Nm - turned[k - 1].out_W.torque_Nm);
    worst = std::max(worst, step - kTorqueSlew_Nm);
  }
  return worst;
}

constexpr std::uint64_t kTicksAScene = 2000;

// Hostile positions and rotations around the limb's point at W's origin; inward is −z.
class HostileTip {
 public:
  explicit HostileTip(std::uint64_t seed) : random_(seed) {}

  TipSample next() {
    const std::uint64_t kind = random_.next() % 12;
    if (kind <= 1) {
      p_ = anywhere(kind == 0 ? 0.1 : 1e-3);
    } else if (kind <= 3) {
      p_ = {0, 0, kind == 2 ? in(-1e-9, 1e-9) : in(-0.2, 0)};
    } else if (kind <= 5) {
      p_ += anywhere(kind == 4 ? 1e-15 : 1e-3);
    } else if (kind == 6) {
      p_ = {0, 0, 0.01};
    } else {
      p_.z += in(-1.5e-3, 1e-3);
      p_ += anywhere(2e-4);
    }
    if (chance(0.001)) p_ = anywhere(1e3);
    if (chance(0.3)) q_ = anyRotation();
    TipSample sample{p_, q_};
    if (chance(0.002)) sample.p_WT_m.x = noNumber();
    if (chance(0.002)) sample.q_WT.w = noNumber();
    return sample;
  }
  bool chance(double share) { return random_.uniform() < share; }

 private:
  double in(double low, double high) { return low + (high - low) * random_.uniform(); }
  Vec3 anywhere(double most) {
    const double x = in(-most, most), y = in(-most, most), z = in(-most, most);
    return {x, y, z};
  }
  Quat anyRotation() {
    if (chance(0.1)) return chance(0.5) ? Quat{0, 0, 0, 1} : Quat{1, 0, 0, 0};
    const double x = in(-1, 1), y = in(-1, 1), z = in(-1, 1), w = in(-1, 1);
    return normalized(Quat{x, y, z, w + 1e-3});
  }
  double noNumber() { return chance(0.5) ? kNaN : -HUGE_VAL; }
  HandRandom random_;
  Vec3 p_;
  Quat q_;
};

struct FuzzFindings {
  bool finite = true;
  double max_force_N = 0;
  double excess_N = 0;         // of the source above the scene's maximum force, after the gate above the peak
  double direction_error = 0;  // | |u| − 1 |
};

// Runs new sources of random scenes for `ticks` ticks in total; every sample goes to one source directly and
// to another behind the gate.
Result<FuzzFindings> fuzzed(const Trial& t, std::uint64_t ticks) {
  FuzzFindings found;
  const double peak_N = DeviceLimits{}.peak_force_N;
  std::uint64_t done = 0;
  for (std::uint64_t seed = 1; done < ticks; ++seed) {
    GestureRange range;
    range.clamping = seed % 2 == 0 ? ClampingMode::kConservative : ClampingMode::kProportional;
    ASSIGN_OR_RETURN(auto scene, sceneSpecOf(randomGesture(seed, range).profile));
    scene.max_force_N = seed % 3 == 0 ? 1.0 : 10.0;
    const SceneSpec rendered = likeForLike(scene, t.model);
    ASSIGN_OR_RETURN(auto source, t.source(rendered, kMotionRate_hz));
    ASSIGN_OR_RETURN(auto behind, t.source(rendered, kMotionRate_hz));
    GatedSource gated(std::move(behind), scene.limb, true);

    HostileTip tip(seed * 0x9E37u);
    StepReport report;
    for (std::uint64_t k = 0; k < kTicksAScene && done < ticks; ++k, ++done) {
      DeviceSample given;
      given.tip = tip.next();
      source->step(given.tip, report);
      const double force = norm(report.wrench_W.force_N);
      found.finite = found.finite && std::isfinite(force) && isFinite(report.wrench_W.torque_Nm);
      found.max_force_N = std::max(found.max_force_N, force);
      found.excess_N = std::max(found.excess_N, force - scene.max_force_N * (1 + 1e-12));
      if (const Vec3 u = source->trajectory(); normSquared(u) > 0)
        found.direction_error = std::max(found.direction_error, std::abs(norm(u) - 1));
      if (!t.settings.control.gate) continue;
      given.acknowledge = tip.chance(0.05);
      const Wrench out = gated.next(given).out_W;
      found.finite = found.finite && isFinite(out.force_N) && isFinite(out.torque_Nm);
      found.excess_N = std::max(found.excess_N, norm(out.force_N) - peak_N * (1 + 1e-12));
    }
  }
  return found;
}

Status flippedAxis(Trial& t) {
  // with FEM each random scene needs its own mesh
  const std::uint64_t fuzzed_ticks =
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

  ASSIGN_OR_RETURN(const auto fuzz, fuzzed(t, fuzzed_ticks));
  CaseRow& row = t.row();
  row.finite = row.finite && fuzz.finite;
  row.max_force_N = std::max(*row.max_force_N, fuzz.max_force_N);
  worst = std::max(worst, fuzz.excess_N);
  t.judge("greatest departure from what is allowed [N, N·m]", worst, t.number("limit", 0),
          fmt::format("{} fuzzed ticks, |u| within {} of 1", fuzzed_ticks,
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
