#include "client/station/run/lesson/memory_follower.h"

#include <cmath>
#include <utility>

#include "common/gesture/chunk.h"
#include "common/haptics/body/path_snapshot.h"
#include "common/haptics/cut_snapshot.h"
#include "common/haptics/effects/resume.h"

namespace needlelab {
namespace {

static_assert(kMaxCutSnapshotBytes <= kMaxCutMemoryBytes && kMaxPathListBytes == kMaxPathsBytes);

// ten steps of the standard resolution: each stored coordinate errs by half a step
constexpr double kClearlyOutside_m = 1e-5;

}  // namespace

MemoryFollower::MemoryFollower(const SceneModel& model) : model_(model) {
  if (model.isLive(Effect::kCutMemory) || model.body_spec) engine_ = std::make_unique<SceneEngine>(model);
}

void MemoryFollower::follow(const GestureSample& sample) {
  if (engine_ == nullptr) return;
  tick_ = sample.tick;
  outside_ = path_begins_ = false;
  // a restart after a FAULT forgets the insertion (HapticChain)
  const bool was_in_fault = std::exchange(in_fault_, sample.fault != 0);
  if ((sample.flags & kFlagNotStepped) != 0) return;  // the loop did not step it either
  const Vec3 p_W_m{sample.p_WT_m[0], sample.p_WT_m[1], sample.p_WT_m[2]};
  const Quat q_W{sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]};
  StepReport report;
  if (was_in_fault && !in_fault_) engine_->leaveTissue();
  if (model_.body_spec) {
    static_cast<void>(engine_->stepAsStored({p_W_m, q_W}, storedTickOf(sample), report));
    judgePath(sample, report);
  } else {
    engine_->stepOnPaths({p_W_m, q_W}, storedTickOf(sample), report);
  }
  left_ = left_ || (report.flags & kFlagExit) != 0;
  const SimState& state = engine_->state();
  outside_ =
      !state.inside && (state.outside_once || engine_->isCapped()) && report.depth_m <= -kClearlyOutside_m;
}

void MemoryFollower::judgePath(const GestureSample& sample, const StepReport& report) {
  constexpr std::uint32_t kDecisions = kFlagNewPath | kFlagKeptPath | kFlagEntry | kFlagExit;
  if (((sample.flags ^ report.flags) & kDecisions) != 0 || sample.layer != report.layer) path_differs_ = true;
  const bool inside = engine_->state().inside;
  path_begins_ = (report.flags & kFlagEntry) != 0 || (inside && (report.flags & kFlagNewPath) != 0);
  const bool is_due = tick_ >= path_due_tick_;
  if (const Bytes list = path(is_due); !list.empty()) {
    // full only if no one has asked for seconds
    if (paths_.size() + list.size() > kMaxPathListBytes) paths_.clear();
    paths_.insert(paths_.end(), list.begin(), list.end());
    if (is_due) path_due_tick_ = tick_ + static_cast<std::uint64_t>(std::llround(model_.rate_hz));
  }
}

Bytes MemoryFollower::cuts() const {
  if (!outside_ || !remembersCuts()) return {};
  return encodeCuts({tick_, engine_->state().cuts, engine_->state().insertions});
}

Bytes MemoryFollower::cutsDue() {
  if (!outside_ || (!left_ && tick_ < due_tick_)) return {};
  left_ = false;
  due_tick_ = tick_ + static_cast<std::uint64_t>(std::llround(model_.rate_hz));
  return cuts();
}

Bytes MemoryFollower::path(bool anyway) const {
  Bytes list;
  if (engine_ == nullptr || path_differs_ || engine_->path() == nullptr || !(anyway || path_begins_))
    return list;
  appendPath({tick_, engine_->pathInUse()}, list);
  return list;
}

Bytes MemoryFollower::pathsDue() {
  return std::exchange(paths_, {});
}

}  // namespace needlelab
