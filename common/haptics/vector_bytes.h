/// Vectors as bytes.
#pragma once

#include <cmath>

#include "common/base/bytes.h"
#include "common/haptics/geometry.h"

namespace needlelab {

inline void putVector(ByteWriter& to, Vec3 v) {
  to.put(v.x);
  to.put(v.y);
  to.put(v.z);
}

inline Vec3 vectorFrom(ByteReader& from) {
  Vec3 v;
  v.x = from.get<double>();
  v.y = from.get<double>();
  v.z = from.get<double>();
  return v;
}

/// Whether a direction from outside is a unit vector, but for rounding.
inline bool isDirection(Vec3 v) {
  return isFinite(v) && std::abs(norm(v) - 1) <= 1e-9;
}

}  // namespace needlelab
