/// Places of targets and hazards that move with the layers.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/haptics/surface.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// A profile's layers under its skin, in the profile's frame. The profile must have passed its rules.
class AnchoredPlaces {
 public:
  /// In a volume, an anchor's layer is looked for down to this depth.
  static constexpr double kReach_m = 0.2;

  explicit AnchoredPlaces(const pb::Profile& profile);

  /// The displacement of an anchored region from the place in its fields: along the surface normal through
  /// its centre (a segment's middle), until the centre is `offset_m` under the top of the anchor's layer. The
  /// line continues beyond a limb's centre; at the centre itself its direction is the frame's z. In a volume
  /// the layer is a structure, and its top where the line from the nearest skin straight in first meets it.
  /// Zero without an anchor, if the move would be a rounding error, or if the line does not meet the
  /// structure.
  [[nodiscard]] Vec3 wayOf(const pb::Target& target) const;
  [[nodiscard]] Vec3 wayOf(const pb::Hazard& hazard) const;
  /// Whether the anchor has a place: in a volume, a line may miss its structure.
  [[nodiscard]] bool hasPlace(const pb::Target& target) const;
  [[nodiscard]] bool hasPlace(const pb::Hazard& hazard) const;

 private:
  struct Top {
    Vec3 skin_m, normal;
    double depth_m = 0;  // of the layer's top under the skin
  };
  [[nodiscard]] std::optional<Top> topIn(const BodyLimb& body, Vec3 center_m, std::size_t structure) const;
  [[nodiscard]] Vec3 wayOf(Vec3 center_m, const pb::Anchor& anchor) const;
  [[nodiscard]] bool hasPlace(Vec3 center_m, const pb::Anchor& anchor) const;

  Limb limb_;
  bool has_limb_ = false;
  std::vector<std::string> names_;
  std::vector<double> tops_m_;
};

/// Checks that each anchor's layer is one of the profile's, and, in a volume, met above its place. Errors:
/// kInvalidInput, with the field.
Status checkAnchors(const pb::Profile& profile);

}  // namespace needlelab
