/// The sample that a station records for a tick if no gate changes the force.
#pragma once

#include "common/gesture/sample.h"
#include "common/haptics/engine.h"

namespace needlelab::test {

/// `report`: of the step with `tip`. One tick per millisecond.
inline GestureSample storedSample(std::uint64_t tick, const TipSample& tip, const StepReport& report) {
  const auto put = [](double(&to)[3], Vec3 v) {
    to[0] = v.x;
    to[1] = v.y;
    to[2] = v.z;
  };
  GestureSample sample;
  sample.tick = tick;
  sample.time_ns = static_cast<std::int64_t>(tick) * 1'000'000;
  put(sample.p_WT_m, tip.p_WT_m);
  sample.q_WT[0] = tip.q_WT.x;
  sample.q_WT[1] = tip.q_WT.y;
  sample.q_WT[2] = tip.q_WT.z;
  sample.q_WT[3] = tip.q_WT.w;
  sample.speed_mps = report.speed_mps;
  put(sample.force_W_N, report.wrench_W.force_N);
  put(sample.torque_W_Nm, report.wrench_W.torque_Nm);
  put(sample.wall_W_m, report.p_wall_W_m);
  sample.insertion_m = report.insertion_m;
  sample.lateral_error_m = report.lateral_error_m;
  sample.flags = report.flags;
  sample.layer = static_cast<std::int8_t>(report.layer);
  sample.phase = static_cast<std::uint8_t>(report.phase);
  return sample;
}

/// The pose of a sample.
inline TipSample tipOf(const GestureSample& sample) {
  return {{sample.p_WT_m[0], sample.p_WT_m[1], sample.p_WT_m[2]},
          {sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]}};
}

}  // namespace needlelab::test
