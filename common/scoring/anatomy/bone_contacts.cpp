#include "common/scoring/anatomy/bone_contacts.h"

#include <algorithm>

#include "common/profile/structure_kinds.h"

namespace needlelab {

BoneContacts::BoneContacts(const pb::Profile& profile, const Anatomy& anatomy) {
  for (const LayerKind& layer : layerKinds(profile)) is_bone_.push_back(layer.tissue == pb::Layer::BONE);
  for (std::size_t i = 0; i < anatomy.hazards.size(); ++i)
    if (hazardKindOf(profile, profile.hazards(static_cast<int>(i))) == pb::Hazard::BONE)
      bones_.push_back(anatomy.hazards[i]);
}

bool BoneContacts::isIn(int layer, Vec3 tip_W_m) const {
  if (layer < 0) return false;
  const auto index = static_cast<std::size_t>(layer);
  if (index < is_bone_.size() && is_bone_[index]) return true;
  return std::any_of(bones_.begin(), bones_.end(),
                     [&](const Region& bone) { return distanceTo(bone, tip_W_m) <= 0; });
}

}  // namespace needlelab
