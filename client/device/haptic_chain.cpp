#include "client/device/haptic_chain.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "common/haptics/gate/force_gate.h"
#include "common/haptics/geometry.h"
#include "common/haptics/surface.h"

namespace needlelab {
namespace {

/// Where the orientation is not measured: from this inserted length on the axis is the line from P0 to the
/// tip.
constexpr double kPointsFrom_m = 2e-3;

// returns the shortest rotation from +z to `axis`, which must not be near −z
Quat shortest(Vec3 axis) {
  return normalized(Quat{-axis.y, axis.x, 0, 1 + axis.z});
}

std::int32_t clampedNs(std::int64_t duration_ns) {
  return static_cast<std::int32_t>(
      std::clamp<std::int64_t>(duration_ns, 0, std::numeric_limits<std::int32_t>::max()));
}

void put(double (&to)[3], Vec3 v) {
  to[0] = v.x;
  to[1] = v.y;
  to[2] = v.z;
}

}  // namespace

Quat rotationOfAxis(Vec3 axis) noexcept {
  // most needles point down: start from −z (half a turn about x), which is near
  if (axis.z > 0) return shortest(axis);
  return Quat{1, 0, 0, 0} * shortest({axis.x, -axis.y, -axis.z});
}

Quat AssumedAxis::at(const SceneModel& model, const SimState& before, Vec3 p_WT_m) const noexcept {
  const double depth_m = signedDepth(model.limb, p_WT_m);
  const bool inside = depth_m > 0;
  if (inside && before.inside) {
    const Vec3 arm = p_WT_m - before.p_entry_W_m;
    return normSquared(arm) < kPointsFrom_m * kPointsFrom_m ? kept_ : rotationOfAxis(normalized(arm));
  }
  const bool enters = inside && before.outside_once;
  // at a sphere's exact centre, without motion, any direction is valid
  Vec3 motion = p_WT_m - before.p_prev_W_m;
  if (normSquared(motion) == 0) motion = {0, 0, -1};
  const Vec3 at = enters ? entryPoint(before, p_WT_m, depth_m) : p_WT_m;
  return rotationOfAxis(-surfaceNormal(model.limb, at, motion));
}

HapticChain::HapticChain(const SceneModel& model, const DeviceLimits& limits, const Pose& X_HT,
                         PathMaker* paths)
    : limb_(model.limb),
      engine_(model, paths),
      X_HT_(X_HT),
      gate_(limits, model.rate_hz),
      plunger_({}, model.rate_hz) {
  assert(model.step_function != nullptr && "compile() made the model");
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  report_.p_wall_W_m = {nan, nan, nan};
}

HapticChain::HapticChain(const SceneModel& model, const DeviceInfo& device, const Pose& X_HT,
                         PlungerSettings plunger, PathMaker* paths)
    : HapticChain(model, device.limits, X_HT, paths) {
  plunger.source = device.plunger;
  plunger_ = Plunger(plunger, model.rate_hz);
  has_orientation_ = device.has_orientation;
  // for a device that renders nothing, the torque is only for the recording
  renders_torque_ = device.renders_torque || !device.renders_force;
}

Pose HapticChain::tipOf(const Pose& X_WH) const noexcept {
  if (has_orientation_) return tipFromHandle(X_WH, X_HT_);
  const Vec3 p_WT_m = X_WH.p + X_HT_.p;
  return {p_WT_m, isFinite(p_WT_m) ? assumed_axis_.at(engine_.model(), engine_.state(), p_WT_m) : Quat{}};
}

Wrench HapticChain::stepped(const Pose& X_WH, const Pose& X_WT, double share) noexcept {
  assert(isFinite(X_WT.p) && isFinite(X_WT.q) && "the gate admitted it");
  handle_ = X_WH;
  tip_ = {X_WT.p, normalized(X_WT.q)};
  engine_.step({tip_.p, tip_.q}, report_);
  if (!has_orientation_) assumed_axis_.keep(tip_.q);
  gate_.noteOutside(report_.depth_m <= 0);
  const Wrench wanted{report_.wrench_W.force_N * share, report_.wrench_W.torque_Nm * share};
  if (!renders_torque_) return {wanted.force_N, {}};
  return wrenchAtHandle(wanted, tip_.p, handle_.p);
}

// keeps the engine's last phase and layer; updates the tip's position as far as known
void HapticChain::skipped(const Pose& X_WH, const Pose& X_WT) noexcept {
  report_.flags = kFlagNotStepped | (report_.flags & kFlagCapped);
  if ((gate_.flags() & kGateSampleRejected) != 0) return;  // a rejected sample does not update the position
  if (!isFinite(X_WT.p) || !isFinite(X_WT.q) || !isFinite(X_WH.p)) return;
  handle_ = X_WH;
  tip_.p = X_WT.p;
  if (dot(X_WT.q, X_WT.q) > 0.25) tip_.q = normalized(X_WT.q);
}

GuardedWrench HapticChain::tick(const DeviceReading& reading, bool fresh, std::int64_t elapsed_ticks,
                                double share, ChainTick& out) noexcept {
  assert(elapsed_ticks > 0 && share >= 0 && share <= 1);
  const Pose X_WT = tipOf(reading.X_WH);
  Wrench wanted_at_handle;
  // a restart after a FAULT begins outside, and the engine forgets the earlier insertion: a needle that is
  // through the limb would pull at once
  const bool in_fault = gate_.fault() != Fault::kNone;
  if (in_fault && fresh && isFinite(X_WT.p)) gate_.noteOutside(signedDepth(limb_, X_WT.p) <= 0);
  const bool admitted =
      gate_.admit({X_WT.p, X_WT.q}, fresh, reading.speed_mps, elapsed_ticks, reading.condition);
  assert(admitted || !in_fault || gate_.fault() != Fault::kNone);
  if (in_fault && gate_.fault() == Fault::kNone) engine_.leaveTissue();
  if (fresh) {
    const bool pressed = (reading.buttons >> kCapButton & 1u) != 0;
    if (pressed && !cap_button_pressed_) switchCap();
    cap_button_pressed_ = pressed;
  }
  if (admitted)
    wanted_at_handle = stepped(reading.X_WH, X_WT, share);
  else
    skipped(reading.X_WH, X_WT);
  if (passivity_) {
    // an orientation that is not measured may have any value
    const Pose handle{reading.X_WH.p, has_orientation_ ? reading.X_WH.q : Quat{}};
    wanted_at_handle =
        passivity_->limited(handle, admitted, wanted_at_handle,
                            heldEnergy_J(engine_.model(), engine_.state(), report_), elapsed_ticks);
  }
  const GuardedWrench guarded = gate_.guard(wanted_at_handle);
  if (passivity_) passivity_->rendered(guarded.wrench());

  next_tick_ += static_cast<std::uint64_t>(elapsed_ticks);
  out.tick = next_tick_ - 1;
  out.X_WH = handle_;
  out.X_WT = tip_;
  out.report = report_;
  out.rendered_W = guarded.wrench();
  // the rendered torque at the handle, converted to the tip
  out.torque_at_tip_Nm = has_orientation_
                             ? out.rendered_W.torque_Nm - cross(tip_.p - handle_.p, out.rendered_W.force_N)
                             : Vec3{};
  out.gate_flags = gate_.flags() | (reading.condition & kDeviceFlags);
  out.fault = gate_.fault();
  out.plunger = plunger_.update(reading, fresh, elapsed_ticks);
  out.buttons = reading.buttons;
  return guarded;
}

GestureSample sampleOf(const ChainTick& tick, std::int64_t time_ns, std::int64_t device_ns,
                       std::int64_t engine_ns) noexcept {
  assert(tick.report.layer >= -1 && tick.report.layer < static_cast<std::int32_t>(kMaxLayers));
  GestureSample sample;
  sample.tick = tick.tick;
  sample.time_ns = time_ns;
  put(sample.p_WT_m, tick.X_WT.p);
  sample.q_WT[0] = tick.X_WT.q.x;
  sample.q_WT[1] = tick.X_WT.q.y;
  sample.q_WT[2] = tick.X_WT.q.z;
  sample.q_WT[3] = tick.X_WT.q.w;
  sample.speed_mps = tick.report.speed_mps;
  put(sample.force_W_N, tick.rendered_W.force_N);
  put(sample.torque_W_Nm, tick.torque_at_tip_Nm);
  put(sample.wall_W_m, tick.report.p_wall_W_m);
  sample.insertion_m = tick.report.insertion_m;
  sample.lateral_error_m = tick.report.lateral_error_m;
  sample.plunger = tick.plunger;
  sample.device_ns = clampedNs(device_ns);
  sample.engine_ns = clampedNs(engine_ns);
  sample.flags = tick.report.flags | tick.gate_flags;
  sample.buttons = tick.buttons;
  sample.layer = static_cast<std::int8_t>(tick.report.layer);
  sample.phase = static_cast<std::uint8_t>(tick.report.phase);
  sample.fault = static_cast<std::uint8_t>(tick.fault);
  return sample;
}

}  // namespace needlelab
