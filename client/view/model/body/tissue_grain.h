/// The grain of tissues in a cut: fat lobules, fibres of muscle and tendon, spongy bone. Deterministic.
#pragma once

#include <vector>

#include "needlelab/profile.pb.h"

namespace needlelab {

inline constexpr double kGrainPeriod_m = 0.024;  ///< along the layers

/// How much lighter or darker a point is, about -0.2 to 0.2. `along`: along the layers, 0 to 1 a period,
/// seamless.
double tissuePattern(pb::Volume::Structure::Kind kind, double depth_m, double along);

/// The same as a table, without end: repeated along the layers, mirrored across them.
class TissueGrain {
 public:
  explicit TissueGrain(pb::Layer::Tissue tissue);
  [[nodiscard]] float at(double depth_m, double along_m) const;

 private:
  std::vector<float> values_;
};
/// Made once, when first asked for, in some 50 ms. Thread: any.
const TissueGrain& tissueGrain(pb::Volume::Structure::Kind kind);

}  // namespace needlelab
