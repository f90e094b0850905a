#include "common/anatomy/field_body.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>
#include <utility>

#include "common/anatomy/march.h"

namespace needlelab {
namespace {

/// Half the distance between the two places that a slope is taken from: far more than rounding, far less than
/// any radius.
constexpr double kHalf_m = 2e-5;
/// A place this far below a surface of bone is in that bone.
constexpr double kBelow_m = 1e-5;
/// Nearer to its edge than this, a ball is not asked: slopes are taken across it.
constexpr double kEdge_m = 1e-3;

/// How a distance changes per length, by central differences; zero where it does not.
template <class Distance>
Vec3 slopeOf(const Distance& distance, Vec3 p_m) noexcept {
  const Vec3 changes{distance(p_m + Vec3{kHalf_m, 0, 0}) - distance(p_m - Vec3{kHalf_m, 0, 0}),
                     distance(p_m + Vec3{0, kHalf_m, 0}) - distance(p_m - Vec3{0, kHalf_m, 0}),
                     distance(p_m + Vec3{0, 0, kHalf_m}) - distance(p_m - Vec3{0, 0, kHalf_m})};
  return norm(changes) > 1e-9 * kHalf_m ? changes / (2 * kHalf_m) : Vec3{};
}

template <class Distance>
Vec3 directionOf(const Distance& distance, Vec3 p_m) noexcept {
  const Vec3 slope = slopeOf(distance, p_m);
  return slope == Vec3{} ? slope : slope / norm(slope);
}

/// The bones of a field: the parts that matter in a ball, and all of them.
class FieldBones final : public Bones {
 public:
  FieldBones(const Field& field, const Field::InBall& all, StructureMask mask, Vec3 center_m, double radius_m)
      : mask_(mask),
        center_m_(center_m),
        radius_m_(radius_m),
        near_(field.inBall(center_m, radius_m, mask)),
        all_(all) {}

  // beyond the ball's edge there may be bone that it does not know
  [[nodiscard]] double distance(Vec3 p_m) const noexcept override {
    const double room_m = radius_m_ - norm(p_m - center_m_);
    if (!(room_m > kEdge_m)) return all_.structuresDistance(mask_, p_m);
    return std::min(near_.structuresDistance(mask_, p_m), room_m);
  }
  [[nodiscard]] Vec3 slope(Vec3 p_m) const noexcept override {
    const Field::InBall near = at(p_m).inBall(p_m, 1.01 * kHalf_m);
    return slopeOf([&](Vec3 p) { return near.structuresDistance(mask_, p); }, p_m);
  }
  [[nodiscard]] StructureIndex structureAt(Vec3 p_m) const noexcept override {
    const StructureIndex here = at(p_m).at(p_m - slope(p_m) * kBelow_m).structure;
    if (here != kOutside && (mask_ >> here & 1u) != 0) return here;
    StructureIndex nearest = 0;
    double least_m = std::numeric_limits<double>::infinity();
    for (StructureIndex i = 0; i < kMaxFieldStructures; ++i) {
      if ((mask_ >> i & 1u) == 0) continue;
      const double here_m = at(p_m).structuresDistance(maskOf(i), p_m);
      if (!(here_m < least_m)) continue;
      least_m = here_m;
      nearest = i;
    }
    return nearest;
  }

 private:
  [[nodiscard]] const Field::InBall& at(Vec3 p_m) const noexcept {
    return radius_m_ - norm(p_m - center_m_) > kEdge_m ? near_ : all_;
  }
  StructureMask mask_;
  Vec3 center_m_;
  double radius_m_;
  Field::InBall near_;
  const Field::InBall& all_;
};

class FieldSurroundings final : public Surroundings {
 public:
  FieldSurroundings(const Field::Piece& skin, const Field::Piece& bones, bool has_bones, Vec3 center_m,
                    double radius_m)
      : has_bones_(has_bones),
        skin_(skin.within(center_m, radius_m)),
        bones_(bones.within(center_m, radius_m)) {}

  [[nodiscard]] DistanceAt skin(Vec3 p_m) const noexcept override {
    const FieldSlope at = skin_.at(p_m);
    return {at.distance_m, at.slope};
  }
  [[nodiscard]] DistanceAt bone(Vec3 p_m) const noexcept override {
    if (!has_bones_) return {std::numeric_limits<double>::infinity(), {}};
    const FieldSlope at = bones_.at(p_m);
    return {at.distance_m, at.slope};
  }
  [[nodiscard]] const Surroundings& within(Vec3 center_m, double radius_m,
                                           Room& room) const noexcept override {
    static_assert(sizeof(FieldSurroundings) <= sizeof(Room));
    return *new (room.bytes.data()) FieldSurroundings(skin_, bones_, has_bones_, center_m, radius_m);
  }

 private:
  bool has_bones_;
  Field::Piece skin_, bones_;
};

}  // namespace

FieldBody::FieldBody(Field field) : field_(std::move(field)) {
  for (std::size_t i = 0; i < field_.structures().size(); ++i)
    if (field_.structures()[i].layer.is_bone) bones_ |= maskOf(static_cast<StructureIndex>(i));
  bone_parts_ = field_.inBall({}, std::numeric_limits<double>::infinity(), bones_);
  skin_piece_ = field_.piece(kWholeBody);
  bone_piece_ = field_.piece(bones_);
}

double FieldBody::depth(Vec3 p_m) const noexcept {
  return -field_.skinDistance(p_m);
}

Vec3 FieldBody::normal(Vec3 p_m) const noexcept {
  return directionOf([this](Vec3 p) { return field_.skinDistance(p); }, p_m);
}

StructureIndex FieldBody::structureAt(Vec3 p_m) const noexcept {
  return field_.at(p_m).structure;
}

LayerStack FieldBody::layersAlong(Vec3 from_m, Vec3 axis, double reach_m, double min_layer_m,
                                  AtBone at_bone) const noexcept {
  MarchOptions options;
  options.reach_m = reach_m;
  options.min_layer_m = min_layer_m;
  options.at_bone = at_bone;
  return march(field_, from_m, axis, options);
}

std::shared_ptr<const Bones> FieldBody::bonesIn(Vec3 center_m, double radius_m) const {
  if (bones_ == 0) return nullptr;
  return std::make_shared<FieldBones>(field_, bone_parts_, bones_, center_m, radius_m);
}

std::shared_ptr<const Surroundings> FieldBody::around(Vec3 center_m, double radius_m) const {
  return std::make_shared<FieldSurroundings>(skin_piece_, bone_piece_, bones_ != 0, center_m, radius_m);
}

}  // namespace needlelab
