/// Places of targets and hazards that move with the layers.
#pragma once

#include <vector>

#include "common/base/result.h"
#include "common/haptics/surface.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// A profile's layers under its skin, in the profile's frame. The profile passed its rules.
class AnchoredPlaces {
 public:
  explicit AnchoredPlaces(const pb::Profile& profile);

  /// How far a region with an anchor is moved from where its fields say: along the surface's normal through
  /// its centre (a segment's middle), until that is `offset_m` under the top of the anchor's layer. The line
  /// goes on beyond a limb's centre; at the centre itself it is the frame's z. Zero without an anchor, and
  /// where rounding alone would move the region.
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
