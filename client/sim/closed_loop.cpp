#include "sim/closed_loop.h"

#include <cmath>
#include <limits>
#include <string>

#include "haptics/tool_transform.h"

namespace needlelab {
namespace {

void put(double (&to)[3], Vec3 v) {
  to[0] = v.x;
  to[1] = v.y;
  to[2] = v.z;
}

Error faultOf(const ChainTick& tick) {
  return {ErrorCode::kFailed,
          "the gate took the force away at tick " + std::to_string(tick.tick) + ": " + faultText(tick.fault)};
}

}  // namespace

HapticChain::HapticChain(const SceneModel& model, const DeviceLimits& limits, const Pose& X_HT)
    : model_(model), X_HT_(X_HT), gate_(limits, model.rate_hz), state_(std::make_unique<SimState>()) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  report_.p_wall_W_m = {nan, nan, nan};
}

GuardedWrench HapticChain::tick(const DeviceReading& reading, bool fresh, ChainTick& out) noexcept {
  out.tick = next_tick_++;
  out.X_WH = reading.X_WH;
  out.X_WT = tipFromHandle(reading.X_WH, X_HT_);
  out.plunger = reading.plunger;
  const TipSample tip{out.X_WT.p, out.X_WT.q};
  Wrench wanted_at_handle;
  if (gate_.admit(tip, fresh, reading.speed_mps)) {
    step(model_, tip, *state_, report_);
    gate_.noteOutside(report_.depth_m <= 0);
    wanted_at_handle = wrenchAtHandle(report_.wrench_W, tip.p_WT_m, reading.X_WH.p);
  } else {
    // phase and layer stand as they were; nothing happened in this tick
    report_.flags = kFlagNotStepped;
  }
  const GuardedWrench guarded = gate_.guard(wanted_at_handle);
  out.report = report_;
  out.rendered_W = guarded.wrench();
  out.gate_flags = gate_.flags();
  out.fault = gate_.fault();
  return guarded;
}

Result<std::vector<ChainTick>> runClosedLoop(const SceneModel& model, Device& device, const Pose& X_HT,
                                             std::uint64_t max_ticks) {
  if (Status status = device.open(model.rate_hz); !status.ok()) return status.error();
  HapticChain chain(model, device.info().limits, X_HT);
  std::vector<ChainTick> ticks;
  DeviceReading reading;
  while (ticks.size() < max_ticks) {
    const DeviceRead read = device.read(reading);
    if (read == DeviceRead::kFinished) break;
    device.write(chain.tick(reading, read == DeviceRead::kFresh, ticks.emplace_back()));
    if (ticks.back().fault != Fault::kNone) {
      device.close();
      return faultOf(ticks.back());
    }
  }
  device.close();
  return ticks;
}

GestureSample gestureSampleOf(const ChainTick& tick, double rate_hz) {
  GestureSample sample;
  sample.tick = tick.tick;
  sample.time_ns = std::llround(static_cast<double>(tick.tick) * 1e9 / rate_hz);
  put(sample.p_WT_m, tick.X_WT.p);
  sample.q_WT[0] = tick.X_WT.q.x;
  sample.q_WT[1] = tick.X_WT.q.y;
  sample.q_WT[2] = tick.X_WT.q.z;
  sample.q_WT[3] = tick.X_WT.q.w;
  sample.speed_mps = tick.report.speed_mps;
  put(sample.force_W_N, tick.rendered_W.force_N);
  put(sample.torque_W_Nm,
      tick.rendered_W.torque_Nm - cross(tick.X_WT.p - tick.X_WH.p, tick.rendered_W.force_N));
  put(sample.wall_W_m, tick.report.p_wall_W_m);
  sample.insertion_m = tick.report.insertion_m;
  sample.lateral_error_m = tick.report.lateral_error_m;
  sample.plunger = tick.plunger;
  sample.flags = tick.report.flags | tick.gate_flags;
  sample.layer = static_cast<std::int8_t>(tick.report.layer);
  sample.phase = static_cast<std::uint8_t>(tick.report.phase);
  sample.fault = static_cast<std::uint8_t>(tick.fault);
  return sample;
}

}  // namespace needlelab
