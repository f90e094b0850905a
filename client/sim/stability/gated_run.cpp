#include "client/sim/stability/gated_run.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "client/device/hand.h"
#include "client/sim/stability/passivity_gesture.h"
#include "common/haptics/force_gate.h"
#include "common/haptics/models/like_for_like.h"
#include "common/profile/profile.h"

namespace needlelab {

GatedTick GatedSource::next(const DeviceSample& sample) {
  const bool admitted = gate_.admit(sample.tip, sample.fresh, 0.0, sample.elapsed_ticks);
  Wrench wanted;
  if (with_gate_ ? admitted : sample.fresh) {
    source_->step(sample.tip, report_);
    wanted = report_.wrench_W;
  } else if (!with_gate_) {
    wanted = report_.wrench_W;  // nothing new: the device keeps the last wrench
  }
  const double depth_m = signedDepth(limb_, sample.tip.p_WT_m);
  gate_.noteOutside(depth_m <= 0);
  if (sample.acknowledge) gate_.acknowledge();
  const Wrench guarded = gate_.guard(wanted).wrench();
  return {sample, report_, with_gate_ ? guarded : wanted, with_gate_ ? gate_.fault() : Fault::kNone, depth_m};
}

Result<std::vector<GatedTick>> runGated(const ForceSourceFactory& make_source, const SceneSpec& scene,
                                        const std::vector<DeviceSample>& samples, double rate_hz,
                                        bool with_gate) {
  ASSIGN_OR_RETURN(auto source, make_source(scene, rate_hz));
  GatedSource gated(std::move(source), scene.limb, rate_hz, with_gate);
  std::vector<GatedTick> ticks;
  ticks.reserve(samples.size());
  for (const DeviceSample& sample : samples) ticks.push_back(gated.next(sample));
  return ticks;
}

double violationOf(const std::vector<GatedTick>& ticks, const FaultTimeline& timeline, bool with_gate) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const auto force = [&](std::size_t k) { return ticks[k].out_W.force_N; };
  for (const GatedTick& tick : ticks)
    if (!isFinite(tick.out_W.force_N) || !isFinite(tick.out_W.torque_Nm)) return kNever;

  // finds the tick of the fault, and checks its kind
  std::size_t fault = timeline.from;
  if (!with_gate) fault += timeline.held_ticks + timeline.slack_ticks;
  while (with_gate && fault < ticks.size() && ticks[fault].fault == Fault::kNone) ++fault;
  if (fault >= ticks.size() || (with_gate && ticks[fault].fault != timeline.fault)) return kNever;
  if (fault < timeline.from + timeline.held_ticks ||
      fault > timeline.from + timeline.held_ticks + timeline.slack_ticks)
    return kNever;

  double violation = 0;
  const Vec3 last = force(timeline.from - 1);
  for (std::size_t k = timeline.from; k < fault; ++k) violation = std::max(violation, norm(force(k) - last));
  for (std::size_t k = fault; k < std::min(timeline.restart, ticks.size()); ++k) {
    violation = std::max(violation, norm(force(k)) - norm(force(k - 1)));  // only ever less
    if (k >= fault + timeline.fade_ticks) violation = std::max(violation, norm(force(k)));
  }
  return violation;
}

namespace {

constexpr std::uint64_t kTicksAScene = 2000;

// about the point of the limb that touches W's origin, inward along −z
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
  double noNumber() {
    return chance(0.5) ? std::numeric_limits<double>::quiet_NaN() : -std::numeric_limits<double>::infinity();
  }
  HandRandom random_;
  Vec3 p_;
  Quat q_;
};

}  // namespace

Result<FuzzFindings> fuzzSource(const ForceSourceFactory& make_source, AxialModel model, std::uint64_t ticks,
                                bool with_gate) {
  FuzzFindings findings;
  const double peak_N = DeviceLimits{}.peak_force_N;
  for (std::uint64_t seed = 1; findings.ticks < ticks; ++seed) {
    GestureRange range;
    range.clamping = seed % 2 == 0 ? ClampingMode::kConservative : ClampingMode::kProportional;
    const PassivityGesture gesture = randomGesture(seed, shapeOf(seed), range);
    ASSIGN_OR_RETURN(auto scene, sceneSpecOf(gesture.profile));
    scene.max_force_N = seed % 3 == 0 ? 1.0 : 10.0;
    const SceneSpec rendered = likeForLike(scene, model);
    ASSIGN_OR_RETURN(auto source, make_source(rendered, 1000));
    ASSIGN_OR_RETURN(auto behind, make_source(rendered, 1000));
    GatedSource gated(std::move(behind), scene.limb, 1000, true);

    HostileTip tip(seed * 0x9E37u);
    StepReport report;
    for (std::uint64_t k = 0; k < kTicksAScene && findings.ticks < ticks; ++k, ++findings.ticks) {
      const TipSample sample = tip.next();
      source->step(sample, report);
      const double force = norm(report.wrench_W.force_N);
      findings.finite = findings.finite && std::isfinite(force) && isFinite(report.wrench_W.torque_Nm);
      findings.max_force_N = std::max(findings.max_force_N, force);
      findings.excess_force_N = std::max(findings.excess_force_N, force - scene.max_force_N * (1 + 1e-12));
      if (const Vec3 u = source->trajectory(); normSquared(u) > 0)
        findings.direction_error = std::max(findings.direction_error, std::abs(norm(u) - 1));
      if (!with_gate) continue;
      DeviceSample given;
      given.tip = sample;
      given.acknowledge = tip.chance(0.05);
      const Wrench out = gated.next(given).out_W;
      findings.finite = findings.finite && isFinite(out.force_N) && isFinite(out.torque_Nm);
      findings.excess_rendered_N =
          std::max(findings.excess_rendered_N, norm(out.force_N) - peak_N * (1 + 1e-12));
    }
  }
  return findings;
}

}  // namespace needlelab
