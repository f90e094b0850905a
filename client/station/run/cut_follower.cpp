#include "client/station/run/cut_follower.h"

#include <cmath>

#include "common/haptics/cut_snapshot.h"

namespace needlelab {

CutFollower::CutFollower(const SceneModel& model)
    : model_(model), state_(model.isLive(Effect::kCutMemory) ? std::make_unique<SimState>() : nullptr) {}

Bytes CutFollower::follow(std::span<const GestureSample> samples) {
  if (state_ == nullptr || samples.empty()) return {};
  StepReport report;
  bool left = false;
  for (const GestureSample& sample : samples) {
    if ((sample.flags & kFlagNotStepped) != 0) continue;  // nor did the loop step it
    const Vec3 p_W_m{sample.p_WT_m[0], sample.p_WT_m[1], sample.p_WT_m[2]};
    const Quat q_W{sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]};
    step(model_, {p_W_m, q_W}, *state_, report);
    left = left || (report.flags & kFlagExit) != 0;
  }
  const std::uint64_t tick = samples.back().tick;
  if (state_->inside || (!left && tick < due_tick_)) return {};
  due_tick_ = tick + static_cast<std::uint64_t>(std::llround(model_.rate_hz));
  return encodeCuts({tick, state_->cuts});
}

}  // namespace needlelab
