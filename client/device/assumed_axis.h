/// The needle's direction for a device that does not measure one.
#pragma once

#include "common/haptics/scene_model.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// The rotation that takes +z to the unit vector `axis`; turned about `axis` in no particular way. Exact for
/// the directions of the axes of W.
Quat rotationOfAxis(Vec3 axis) noexcept;

/// The needle stands on the skin: outside the tissue its axis is the inward normal at the nearest point of
/// the limb, at the entry the inward normal at P0 as the engine computes it, and that one is kept for the
/// insertion. So the engine's u is −n. Thread: one. Real-time safe.
class AssumedAxis {
 public:
  /// The tip's orientation in the tick to come, for a tip at `p_WT_m`. `before`: the engine's state after the
  /// last tick.
  [[nodiscard]] Quat at(const SceneModel& model, const SimState& before, Vec3 p_WT_m) const noexcept;
  /// That tick was stepped with `q_WT`: an insertion keeps it.
  void keep(Quat q_WT) noexcept { kept_ = q_WT; }

 private:
  Quat kept_;
};

}  // namespace needlelab
