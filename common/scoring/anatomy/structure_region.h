/// A structure of a body as a region in W: the distance from it, and where it is nearest.
#pragma once

#include <memory>

#include "common/anatomy/field_body.h"

namespace needlelab {

/// Immutable; any number of threads may ask at once. Nothing allocates. All places are in W.
class StructureRegion {
 public:
  /// `body` is not null. `structures`: a bit for each structure that is part of the region. `X_WL` must have
  /// a unit quaternion.
  StructureRegion(std::shared_ptr<const FieldBody> body, StructureMask structures, const Pose& X_WL)
      : body_(std::move(body)), structures_(structures), X_WL_(X_WL), X_LW_(inverse(X_WL)) {}

  /// The signed distance, negative inside: exact at the surface, elsewhere of the right sign and not too
  /// great by more than a ninth (field.h).
  [[nodiscard]] double distance(Vec3 p_W_m) const noexcept {
    return body_->field().structuresDistance(structures_, X_LW_ * p_W_m);
  }
  /// The least distance on a straight shaft. Above 0 exactly if no part of the shaft of 0.1 mm is inside;
  /// once it is not, the value is that of the first place found.
  [[nodiscard]] double distanceFromShaft(Vec3 tip_W_m, Vec3 skin_W_m) const noexcept;
  /// A point of the surface near `p_W_m`, found along the distance's slope: the nearest one where the surface
  /// is smooth.
  [[nodiscard]] Vec3 nearest(Vec3 p_W_m) const noexcept;

 private:
  std::shared_ptr<const FieldBody> body_;
  StructureMask structures_;
  Pose X_WL_, X_LW_;
};

}  // namespace needlelab
