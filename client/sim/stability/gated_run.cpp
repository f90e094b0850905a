#include "client/sim/stability/gated_run.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace needlelab {

Result<std::vector<GatedTick>> runGated(const ForceSourceFactory& make_source, const SceneSpec& scene,
                                        const std::vector<DeviceSample>& samples, double rate_hz,
                                        bool with_gate) {
  auto source = make_source(scene, rate_hz);
  if (!source.ok()) return source.error();
  ForceGate gate(DeviceLimits{}, rate_hz);
  std::vector<GatedTick> ticks;
  ticks.reserve(samples.size());
  StepReport report;
  for (const DeviceSample& sample : samples) {
    GatedTick& tick = ticks.emplace_back();
    tick.sample = sample;
    const bool admitted = gate.admit(sample.tip, sample.fresh, 0.0);
    Wrench wanted;
    if (with_gate ? admitted : sample.fresh) {
      (*source)->step(sample.tip, report);
      wanted = report.wrench_W;
    } else if (!with_gate) {
      wanted = report.wrench_W;  // nothing new: the device goes on with what it has
    }
    tick.depth_m = signedDepth(scene.limb, sample.tip.p_WT_m);
    gate.noteOutside(tick.depth_m <= 0);
    if (sample.acknowledge) gate.acknowledge();
    const GuardedWrench guarded = gate.guard(wanted);
    tick.report = report;
    tick.out_W = with_gate ? guarded.wrench() : wanted;
    tick.fault = with_gate ? gate.fault() : Fault::kNone;
  }
  return ticks;
}

double violationOf(const std::vector<GatedTick>& ticks, const FaultTimeline& timeline, bool with_gate) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const auto force = [&](std::size_t k) { return ticks[k].out_W.force_N; };
  for (const GatedTick& tick : ticks)
    if (!isFinite(tick.out_W.force_N) || !isFinite(tick.out_W.torque_Nm)) return kNever;

  // the tick of the fault, and that it is the right one
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

}  // namespace needlelab
