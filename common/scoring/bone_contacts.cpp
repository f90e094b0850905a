#include "common/scoring/bone_contacts.h"

#include <algorithm>

namespace needlelab {

BoneContacts::BoneContacts(const pb::Profile& profile, const Anatomy& anatomy) {
  for (const pb::Layer& layer : profile.layers()) is_bone_.push_back(layer.tissue() == pb::Layer::BONE);
  for (std::size_t i = 0; i < anatomy.hazards.size(); ++i)
    if (profile.hazards(static_cast<int>(i)).kind() == pb::Hazard::BONE) bones_.push_back(anatomy.hazards[i]);
}

bool BoneContacts::isIn(int layer, Vec3 tip_W_m) const {
  if (layer < 0) return false;
  const auto index = static_cast<std::size_t>(layer);
  if (index < is_bone_.size() && is_bone_[index]) return true;
  return std::any_of(bones_.begin(), bones_.end(),
                     [&](const Region& bone) { return distanceTo(bone, tip_W_m) <= 0; });
}

bool BoneContacts::add(double time_s, int layer, Vec3 tip_W_m) {
  if (!isIn(layer, tip_W_m)) {
    if (in_contact_ && !away_since_s_) away_since_s_ = time_s;
    return false;
  }
  // a hair less, so that the last digit of a time does not decide
  const bool begins = !in_contact_ || (away_since_s_ && time_s - *away_since_s_ >= kBoneAway_s * (1 - 1e-9));
  in_contact_ = true;
  away_since_s_.reset();
  return begins;
}

void BoneContacts::restart() {
  in_contact_ = false;
  away_since_s_.reset();
}

}  // namespace needlelab
