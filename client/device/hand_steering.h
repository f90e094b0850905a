/// What somebody wants of a simulated hand while it moves: the way from a window to the haptic thread.
#pragma once

#include "common/base/wait_free.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// Where the needle's tip shall be now, in W, and the plunger.
struct SteeringWish {
  Pose X_WT;
  double plunger = 0;  ///< 0-1
};

/// The newest wish counts. Neither side ever waits: a window that stands still leaves a hand at rest, and a
/// loop that ends leaves a window that speaks to nobody. Thread: `wish` by one, `fetch` by the haptic thread
/// alone.
class HandSteering {
 public:
  void wish(const SteeringWish& wish) noexcept { newest_.publish(wish); }
  /// True when `wish` is newer than at the last call. Real-time safe.
  bool fetch(SteeringWish& wish) noexcept { return newest_.fetch(wish); }

 private:
  LatestValue<SteeringWish> newest_;
};

}  // namespace needlelab
