/// What a scene's layers ask for, tick by tick: the comparator of the axial models.
#pragma once

#include <cstddef>

#include "client/sim/accuracy/gesture.h"

namespace needlelab {

/// The force along the trajectory that the profile's numbers name, without the springs by which a model gets
/// there: −f_cut of the layer on the way in, +f_att on the way out, in a rest the fall from there to f_rej
/// (DESIGN §3.2: after the dwell; linear in the stop's duration, or exponential to the residual). Zero
/// outside. It jumps at layers, as the profile does. Thread: one.
class ForceProfile {
 public:
  ForceProfile(const SceneSpec& spec, double rate_hz);

  /// One tick. `depth_m`: δ of the tip. In N, negative = against the insertion.
  double next(double depth_m, Intent intent);

 private:
  [[nodiscard]] const LayerSpec& layerAt(double depth_m) const;
  [[nodiscard]] double atRest(double depth_m) const;
  SceneSpec spec_;
  double period_s_;
  double moving_N_ = 0;  // when the hand last moved
  double rest_s_ = 0;    // since then
};

}  // namespace needlelab
