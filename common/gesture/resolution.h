/// The steps to which a gesture's columns are rounded when they are stored (DESIGN §6).
#pragma once

#include "common/base/result.h"

namespace needlelab {

/// One step for each kind of column. The stored error is at most half a step in every value; a step of 0
/// stores the kind's raw double bits (lossless). The tick number and `time_ns` are always exact.
struct Resolution {
  double length_m = 1e-6;       ///< tip, wall, insertion, lateral error
  double quaternion = 0x1p-15;  ///< the four components; also `plunger`, which has no dimension either
  double force_N = 1e-3;
  double torque_Nm = 1e-4;
  double time_s = 1e-6;  ///< device and engine time of a tick; below 1 ns it means 1 ns, which is exact
  double speed_mps = 1e-4;

  static Resolution standard() { return {}; }
  static Resolution lossless() { return {0, 0, 0, 0, 0, 0}; }
  friend bool operator==(const Resolution&, const Resolution&) = default;
};

/// Every step must be 0 or within [1e-12, 1]. Errors (kInvalidInput) name the field, the value and the range.
Status validate(const Resolution& resolution);

}  // namespace needlelab
