/// Watches a gesture during the lesson, with the definitions of `scoreGesture`: peak force, touched hazards
/// and bone, the hub on the skin, layer, alarms.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "common/scoring/alarms/alarms.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Costs about 10 ns per sample and hazard while the tip is in tissue. Thread: one.
class LessonWatch {
 public:
  /// `X_WL`: pose of the profile's frame in W. `exercise`: its limit on peak_force_n is used, if it has one.
  LessonWatch(const pb::Profile& profile, const Pose& X_WL, const pb::Exercise* exercise = nullptr);
  LessonWatch(LessonWatch&&) noexcept;
  LessonWatch& operator=(LessonWatch&&) noexcept;
  ~LessonWatch();

  /// Adds the next samples, in the order of ticks. Skips samples that are not finite.
  void add(std::span<const GestureSample> samples);

  /// Greatest |force| on the hand so far, N.
  [[nodiscard]] double peakForce_N() const { return peak_force_N_; }
  /// The exercise's limit on peak_force_n; 0: none.
  [[nodiscard]] double forceLimit_N() const { return force_limit_N_; }
  /// Names of the touched hazards, in the order of first touch by the tip or by the shaft in tissue.
  [[nodiscard]] const std::vector<std::string>& hazardsTouched() const { return touched_; }
  /// Warnings for the instructor: the names in hazardsTouched(), kBoneContactWords at the first contact of
  /// the tip with bone, and kHubContactWords at the first contact of the hub with the skin.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }
  /// The alarms for trainee and instructor.
  [[nodiscard]] const GestureAlarms& alarms() const { return alarms_; }
  /// The display name of the tip's current layer, e.g. "deltoid muscle"; empty outside.
  [[nodiscard]] const std::string& layerName() const { return layer_name_; }

 private:
  struct Scene;
  void check(const GestureSample& sample);
  std::unique_ptr<Scene> scene_;
  GestureAlarms alarms_;
  double peak_force_N_ = 0, force_limit_N_ = 0;
  int layer_ = -1;
  std::vector<std::string> touched_, warnings_;
  std::string layer_name_;
};

}  // namespace needlelab
