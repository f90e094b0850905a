#include "client/station/run/lesson/cut_follower.h"

#include <cmath>

#include "common/haptics/cut_snapshot.h"

namespace needlelab {
namespace {

// ten steps of the standard resolution: each stored coordinate errs by half a step
constexpr double kClearlyOutside_m = 1e-5;

}  // namespace

CutFollower::CutFollower(const SceneModel& model)
    : model_(model), state_(model.isLive(Effect::kCutMemory) ? std::make_unique<SimState>() : nullptr) {}

void CutFollower::follow(const GestureSample& sample) {
  if (state_ == nullptr) return;
  tick_ = sample.tick;
  outside_ = false;
  if ((sample.flags & kFlagNotStepped) != 0) return;  // the loop did not step it either
  const Vec3 p_W_m{sample.p_WT_m[0], sample.p_WT_m[1], sample.p_WT_m[2]};
  const Quat q_W{sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]};
  StepReport report;
  step(model_, {p_W_m, q_W}, *state_, report);
  left_ = left_ || (report.flags & kFlagExit) != 0;
  outside_ = !state_->inside && state_->outside_once && report.depth_m <= -kClearlyOutside_m;
}

Bytes CutFollower::memory() const {
  return outside_ ? encodeCuts({tick_, state_->cuts, state_->insertions}) : Bytes();
}

Bytes CutFollower::due() {
  if (!outside_ || (!left_ && tick_ < due_tick_)) return {};
  left_ = false;
  due_tick_ = tick_ + static_cast<std::uint64_t>(std::llround(model_.rate_hz));
  return memory();
}

}  // namespace needlelab
