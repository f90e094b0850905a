/// Gestures made by formula, and the rows of their scores.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "common/haptics/engine.h"
#include "common/scoring/measures/measures.h"

namespace needlelab {

inline void setTip(GestureSample& sample, Vec3 p) {
  sample.p_WT_m[0] = p.x;
  sample.p_WT_m[1] = p.y;
  sample.p_WT_m[2] = p.z;
}

/// The needle points down (from +z to −z), then is turned by `angle` about x.
inline void setDown(GestureSample& sample, double angle = 0) {
  const double half = 0.5 * (std::acos(-1.0) + angle);
  sample.q_WT[0] = std::sin(half);
  sample.q_WT[1] = sample.q_WT[2] = 0;
  sample.q_WT[3] = std::cos(half);
}

/// Returns samples at 0, 1/rate, … up to and including `duration_s`. Each starts with the needle down and
/// outside, then `fill(t, sample)` changes it.
inline std::vector<GestureSample> gesture(double rate_hz, double duration_s,
                                          const std::function<void(double, GestureSample&)>& fill) {
  const auto count = static_cast<std::uint64_t>(std::floor(duration_s * rate_hz + 0.5)) + 1;
  std::vector<GestureSample> samples(count);
  for (std::uint64_t k = 0; k < count; ++k) {
    const double t = static_cast<double>(k) / rate_hz;
    samples[k].tick = 1000 + k;
    samples[k].time_ns = static_cast<std::int64_t>(t * 1e9);
    setDown(samples[k]);
    fill(t, samples[k]);
  }
  return samples;
}

/// Tip at (0, 0, −depth), in layer `depth / 10 mm` of three when inside.
inline void setDepth(GestureSample& sample, double depth_m) {
  setTip(sample, {0, 0, -depth_m});
  sample.layer = static_cast<std::int8_t>(depth_m > 0 ? std::min(2, static_cast<int>(depth_m / 0.01)) : -1);
  sample.insertion_m = std::max(0.0, depth_m);
  sample.phase = static_cast<std::uint8_t>(depth_m > 0 ? Phase::kInserting : Phase::kFree);
}

/// A half-space below z = 0 with three layers of 10 mm.
inline pb::Profile halfSpace() {
  pb::Profile profile;
  auto& plane = *profile.mutable_limb()->mutable_plane();
  plane.mutable_point_m();
  plane.mutable_normal()->set_z(2);
  for (const auto tissue : {pb::Layer::SKIN, pb::Layer::MUSCLE, pb::Layer::BONE}) {
    auto& layer = *profile.add_layers();
    layer.set_tissue(tissue);
    layer.set_thickness_m(0.01);
  }
  return profile;
}

inline void addTarget(pb::Profile& profile, Vec3 center, double radius_m) {
  auto& target = *profile.add_targets();
  target.set_name("target " + std::to_string(profile.targets_size()));
  target.mutable_center_m()->set_x(center.x);
  target.mutable_center_m()->set_y(center.y);
  target.mutable_center_m()->set_z(center.z);
  target.set_radius_m(radius_m);
}

inline void addBallHazard(pb::Profile& profile, const std::string& name, Vec3 center, double radius_m) {
  auto& hazard = *profile.add_hazards();
  hazard.set_name(name);
  hazard.mutable_center_m()->set_x(center.x);
  hazard.mutable_center_m()->set_y(center.y);
  hazard.mutable_center_m()->set_z(center.z);
  hazard.set_radius_m(radius_m);
}

inline const Measure* find(const std::vector<Measure>& score, const std::string& name) {
  for (const Measure& measure : score) {
    if (measure.name == name) return &measure;
  }
  return nullptr;
}

inline double valueOf(const std::vector<Measure>& score, const std::string& name) {
  const Measure* measure = find(score, name);
  EXPECT_NE(measure, nullptr) << name;
  return measure == nullptr ? std::nan("") : measure->value;
}

/// Minimum-jerk motion from 0 to 1 in `duration`, from rest to rest.
inline double ease(double t, double duration) {
  const double s = std::min(1.0, std::max(0.0, t / duration));
  return s * s * s * (10 + s * (6 * s - 15));
}

/// Starts 20 mm above the skin, goes in to 25 mm within 2 s, rests 1 s, comes out within 2 s. Forces along z:
/// 1, 2, 3 N by layer.
inline std::vector<GestureSample> inAndOut(double rate_hz) {
  return gesture(rate_hz, 5, [](double t, GestureSample& s) {
    const double way = t < 3 ? ease(t, 2) : 1 - ease(t - 3, 2);
    setDepth(s, -0.02 + 0.045 * way);
    if (s.layer >= 0) {
      s.force_W_N[2] = s.layer + 1;
      s.phase = static_cast<std::uint8_t>(t < 2   ? Phase::kInserting
                                          : t < 3 ? Phase::kStopped
                                                  : Phase::kWithdrawing);
    }
  });
}

}  // namespace needlelab
