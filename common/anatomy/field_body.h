/// A field as the engine's body.
#pragma once

#include <memory>

#include "common/anatomy/field.h"
#include "common/haptics/body.h"

namespace needlelab {

/// Owns its field. Immutable; any number of threads may ask at once.
class FieldBody final : public Body {
 public:
  explicit FieldBody(Field field);
  FieldBody(const FieldBody&) = delete;  // its bones refer to its field
  FieldBody& operator=(const FieldBody&) = delete;

  [[nodiscard]] double depth(Vec3 p_m) const noexcept override;
  [[nodiscard]] Vec3 normal(Vec3 p_m) const noexcept override;
  [[nodiscard]] StructureIndex structureAt(Vec3 p_m) const noexcept override;
  [[nodiscard]] LayerStack layersAlong(Vec3 from_m, Vec3 axis, double reach_m, double min_layer_m,
                                       AtBone at_bone) const noexcept override;
  [[nodiscard]] std::shared_ptr<const Bones> bonesIn(Vec3 center_m, double radius_m) const override;
  [[nodiscard]] std::shared_ptr<const Surroundings> around(Vec3 center_m, double radius_m) const override;

  [[nodiscard]] const Field& field() const { return field_; }

 private:
  Field field_;
  StructureMask bones_ = 0;
  Field::InBall bone_parts_;
  Field::Piece skin_piece_, bone_piece_;
};

}  // namespace needlelab
