/// Watches a gesture while it goes on: its greatest force, the hazards that were touched, the tissue; with
/// the definitions of `scoreGesture`.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Costs some 10 ns a sample and hazard while the tip is in tissue. Thread: one.
class LessonWatch {
 public:
  /// `X_WL`: where the profile's frame stands in W. `exercise`: its limit on peak_force_n, if it has one.
  LessonWatch(const pb::Profile& profile, const Pose& X_WL, const pb::Exercise* exercise = nullptr);
  LessonWatch(LessonWatch&&) noexcept;
  LessonWatch& operator=(LessonWatch&&) noexcept;
  ~LessonWatch();

  /// The next samples, in the order of ticks. Those that are not finite are passed over.
  void add(std::span<const GestureSample> samples);

  /// Greatest |force| on the hand so far, N.
  [[nodiscard]] double peakForce_N() const { return peak_force_N_; }
  /// Of the exercise's requirement on peak_force_n; 0: none.
  [[nodiscard]] double forceLimit_N() const { return force_limit_N_; }
  /// Names, in the order in which they were touched first: the tip or the shaft in tissue came to them.
  [[nodiscard]] const std::vector<std::string>& hazardsTouched() const { return touched_; }
  /// Of the layer that the tip is in now, in lower case: "muscle"; empty outside.
  [[nodiscard]] const std::string& tissue() const { return tissue_; }

 private:
  struct Scene;
  void check(const GestureSample& sample);
  std::unique_ptr<Scene> scene_;
  double peak_force_N_ = 0, force_limit_N_ = 0;
  int layer_ = -1;
  std::vector<std::string> touched_;
  std::string tissue_;
};

}  // namespace needlelab
