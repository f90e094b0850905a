/// A piece of a body in a tick that asks it often about one place: first a smaller piece is made, on the
/// stack. The same bits. Real-time safe.
#pragma once

#include "common/haptics/scene_model.h"

namespace needlelab {

class Nearby {
 public:
  /// In W; `piece` and `placed` outlive it.
  Nearby(const PlacedSurroundings& placed, const Surroundings& piece, Vec3 place_W_m,
         double radius_m) noexcept
      : placed_(placed),
        piece_(piece),
        place_L_m_(placed.X_LW * place_W_m),
        radius2_m2_(radius_m * radius_m),
        near_(piece.within(place_L_m_, radius_m, room_)) {}
  Nearby(const Nearby&) = delete;
  Nearby& operator=(const Nearby&) = delete;

  [[nodiscard]] DistanceAt skin(Vec3 p_W_m) const noexcept {
    const Vec3 p_L_m = placed_.X_LW * p_W_m;
    return placed_.placed(at(p_L_m).skin(p_L_m));
  }
  [[nodiscard]] DistanceAt bone(Vec3 p_W_m) const noexcept {
    const Vec3 p_L_m = placed_.X_LW * p_W_m;
    return placed_.placed(at(p_L_m).bone(p_L_m));
  }

 private:
  [[nodiscard]] const Surroundings& at(Vec3 p_L_m) const noexcept {
    return normSquared(p_L_m - place_L_m_) < radius2_m2_ ? near_ : piece_;
  }
  const PlacedSurroundings& placed_;
  const Surroundings& piece_;
  Vec3 place_L_m_;
  double radius2_m2_;
  Surroundings::Room room_;
  const Surroundings& near_;
};

}  // namespace needlelab
