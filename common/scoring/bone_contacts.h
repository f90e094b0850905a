/// Contacts of the tip with bone, while a gesture goes on or afterwards: the measure `bone_contacts`, the
/// station's warning, and the marks of plots and reports.
#pragma once

#include <string_view>
#include <vector>

#include "common/scoring/anatomy.h"
#include "common/scoring/contacts.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// The event's name for people.
inline constexpr std::string_view kBoneContactWords = "bone contact";

/// Bone is a layer whose tissue is BONE, or a hazard of the kind BONE. Where they overlap (a humeral head in
/// a layer of bone), they are one bone. Only the tip counts: a shaft that lies along a bone touches a hazard.
/// Thread: one.
class BoneContacts {
 public:
  BoneContacts() = default;  ///< no bone anywhere
  /// `anatomy`: of the same profile.
  BoneContacts(const pb::Profile& profile, const Anatomy& anatomy);

  /// Whether a tip in tissue is in bone. `layer`: the engine's, −1 outside.
  [[nodiscard]] bool isIn(int layer, Vec3 tip_W_m) const;
  /// Takes the next moment, as Contacts::add().
  bool add(double time_s, int layer, Vec3 tip_W_m) { return contacts_.add(time_s, isIn(layer, tip_W_m)); }
  /// Begins another gesture with the same bones.
  void restart() { contacts_ = {}; }

 private:
  std::vector<bool> is_bone_;  // by layer
  std::vector<Region> bones_;
  Contacts contacts_;
};

}  // namespace needlelab
