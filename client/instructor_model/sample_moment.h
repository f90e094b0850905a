/// A Moment from a sample alone, where the engine cannot step along: what the sample carries, and nothing
/// more.
#pragma once

#include "gesture/sample.h"
#include "view_model/gesture_replica.h"

namespace needlelab {

/// `loop_rate_hz`: of the ticks' numbers. Entry, trajectory, α and the parts of the force stay unknown.
inline Moment momentOfSample(const GestureSample& sample, double loop_rate_hz) {
  Moment moment;
  moment.tick = sample.tick;
  moment.time_s = static_cast<double>(sample.tick) / loop_rate_hz;
  moment.p_WT_m = {sample.p_WT_m[0], sample.p_WT_m[1], sample.p_WT_m[2]};
  moment.q_WT = {sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]};
  moment.force_W_N = {sample.force_W_N[0], sample.force_W_N[1], sample.force_W_N[2]};
  moment.torque_W_Nm = {sample.torque_W_Nm[0], sample.torque_W_Nm[1], sample.torque_W_Nm[2]};
  moment.wall_W_m = {sample.wall_W_m[0], sample.wall_W_m[1], sample.wall_W_m[2]};
  moment.phase = sample.phase <= static_cast<std::uint8_t>(Phase::kWithdrawing)
                     ? static_cast<Phase>(sample.phase)
                     : Phase::kFree;
  moment.layer = sample.layer;
  moment.insertion_m = sample.insertion_m;
  moment.speed_mps = sample.speed_mps;
  moment.lateral_error_m = sample.lateral_error_m;
  moment.plunger = sample.plunger;
  moment.flags = sample.flags;
  moment.buttons = sample.buttons;
  moment.fault = sample.fault;
  moment.depth_m = sample.insertion_m;
  moment.approximate = true;
  return moment;
}

}  // namespace needlelab
