#include "common/scoring/alarms/lesson_watch.h"

#include <algorithm>
#include <cmath>

#include "common/profile/layer_names.h"
#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/anatomy/bone_contacts.h"
#include "common/scoring/anatomy/contacts.h"
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/motion/recorded_samples.h"

namespace needlelab {

struct LessonWatch::Scene {
  Anatomy anatomy;
  BoneContacts bones;
  bool bone_touched = false, hub_touched = false;
  std::vector<bool> touched;             // by hazard
  std::vector<std::string> layer_names;  // by layer
};

LessonWatch::LessonWatch(const pb::Profile& profile, const Pose& X_WL, const pb::Exercise* exercise)
    : scene_(std::make_unique<Scene>()) {
  scene_->anatomy = anatomyOf(profile, X_WL);
  alarms_ = GestureAlarms(profile, scene_->anatomy, alarmLimitsOf(scene_->anatomy, exercise));
  scene_->bones = BoneContacts(profile, scene_->anatomy);
  scene_->touched.assign(scene_->anatomy.hazards.size(), false);
  scene_->layer_names = layerNames(profile);
  if (exercise == nullptr) return;
  for (const auto& requirement : exercise->requirements()) {
    if (roleOf(requirement.measure()) == MeasureRole::kForce && requirement.has_max())
      force_limit_N_ = requirement.max();
  }
}

LessonWatch::LessonWatch(LessonWatch&&) noexcept = default;
LessonWatch& LessonWatch::operator=(LessonWatch&&) noexcept = default;
LessonWatch::~LessonWatch() = default;

void LessonWatch::add(std::span<const GestureSample> samples) {
  for (const GestureSample& sample : samples) check(sample);
}

void LessonWatch::check(const GestureSample& sample) {
  const double force_N = norm({sample.force_W_N[0], sample.force_W_N[1], sample.force_W_N[2]});
  const bool counts = std::isfinite(force_N) && (sample.flags & kFlagCapped) == 0;
  if (counts) peak_force_N_ = std::max(peak_force_N_, force_N);
  if (sample.layer != layer_) {
    layer_ = sample.layer;
    const auto index = static_cast<std::size_t>(layer_);
    layer_name_ = layer_ >= 0 && index < scene_->layer_names.size() ? scene_->layer_names[index] : "";
  }
  const Vec3 tip_W_m{sample.p_WT_m[0], sample.p_WT_m[1], sample.p_WT_m[2]};
  const Quat q_WT{sample.q_WT[0], sample.q_WT[1], sample.q_WT[2], sample.q_WT[3]};
  const bool inside = isInside(sample) && isFinite(tip_W_m) && isFinite(q_WT) && dot(q_WT, q_WT) > 0.25 &&
                      std::isfinite(sample.insertion_m);
  const Vec3 skin_W_m = inside ? tip_W_m - sample.insertion_m * zAxis(normalized(q_WT)) : Vec3{};
  alarms_.add({1e-9 * static_cast<double>(sample.time_ns), counts ? force_N : 0, inside, tip_W_m, skin_W_m,
               sample.layer, (sample.flags & kFlagBeyondNeedle) != 0});
  if (!inside) return;
  if (!scene_->bone_touched && scene_->bones.isIn(sample.layer, tip_W_m)) {
    scene_->bone_touched = true;
    warnings_.emplace_back(kBoneContactWords);
  }
  if (!scene_->hub_touched && (sample.flags & kFlagBeyondNeedle) != 0) {
    scene_->hub_touched = true;
    warnings_.emplace_back(kHubContactWords);
  }
  for (std::size_t h = 0; h < scene_->touched.size(); ++h) {
    const Region& hazard = scene_->anatomy.hazards[h];
    if (scene_->touched[h] || distanceTo(hazard, tip_W_m, skin_W_m) > 0) continue;
    scene_->touched[h] = true;
    touched_.push_back(hazard.name);
    warnings_.push_back(hazard.name);
  }
}

}  // namespace needlelab
