/// Small turns as vectors.
#pragma once

#include "common/haptics/geometry.h"

namespace needlelab {

/// Twice the vector part of the turn from `from` to `to`, the short way: the rotation vector of a small turn,
/// in the frame in which both stand; its length is 2 sin(angle/2).
inline Vec3 turnVector(Quat from, Quat to) {
  const Quat d = to * conjugate(from);
  return Vec3{d.x, d.y, d.z} * (d.w < 0 ? -2.0 : 2.0);
}

}  // namespace needlelab
