/// Places of targets and hazards that move with the layers.
#pragma once

#include <vector>

#include "common/base/result.h"
#include "common/haptics/surface.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// A profile's layers under its skin, in the profile's frame. The profile must have passed its rules.
class AnchoredPlaces {
 public:
  explicit AnchoredPlaces(const pb::Profile& profile);

  /// The displacement of an anchored region from the place in its fields: along the surface normal through
  /// its centre (a segment's middle), until the centre is `offset_m` under the top of the anchor's layer. The
  /// line continues beyond a limb's centre; at the centre itself its direction is the frame's z. Zero without
  /// an anchor, or if the move would be a rounding error.
  [[nodiscard]] Vec3 wayOf(const pb::Target& target) const;
  [[nodiscard]] Vec3 wayOf(const pb::Hazard& hazard) const;

 private:
  [[nodiscard]] Vec3 wayOf(Vec3 center_m, const pb::Anchor& anchor) const;

  Limb limb_;
  bool has_limb_ = false;
  std::vector<std::string> names_;
  std::vector<double> tops_m_;
};

/// Checks that each anchor's layer is one of the profile's. Errors: kInvalidInput, with the field.
Status checkAnchors(const pb::Profile& profile);

}  // namespace needlelab
