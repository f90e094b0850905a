/// Contacts of the tip with bone, during or after a gesture: for the measure `bone_contacts`, the station's
/// warning, and marks in plots and reports.
#pragma once

#include <string_view>
#include <vector>

#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/anatomy/contacts.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// The event's display name.
inline constexpr std::string_view kBoneContactWords = "bone contact";

/// Bone is a layer of tissue BONE, or a hazard of kind BONE. Where they overlap (a humeral head in a layer of
/// bone), they are one bone. Only the tip counts; a shaft that lies along a bone touches a hazard. Thread:
/// one.
class BoneContacts {
 public:
  BoneContacts() = default;  ///< no bone at all
  /// `anatomy`: the same profile's.
  BoneContacts(const pb::Profile& profile, const Anatomy& anatomy);

  /// Whether a tip in tissue is in bone. `layer`: the engine's, −1 outside.
  [[nodiscard]] bool isIn(int layer, Vec3 tip_W_m) const;
  /// Adds the next moment, like Contacts::add().
  bool add(double time_s, int layer, Vec3 tip_W_m) { return contacts_.add(time_s, isIn(layer, tip_W_m)); }
  /// Begins another gesture with the same bones.
  void restart() { contacts_ = {}; }

 private:
  std::vector<bool> is_bone_;  // by layer
  std::vector<Region> bones_;
  Contacts contacts_;
};

}  // namespace needlelab
