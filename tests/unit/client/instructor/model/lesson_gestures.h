/// Lessons made by formula: a hand over a sample's shoulder, with the engine's forces.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "client/instructor/model/stored_gesture.h"
#include "common/base/files.h"
#include "common/base/uuid.h"
#include "common/haptics/engine.h"
#include "common/profile/profile.h"

namespace needlelab::test {

inline std::string sampleProfile(const std::string& name) {
  auto text = readWholeFile(std::string(NEEDLELAB_SAMPLES) + "/" + name + ".json");
  EXPECT_TRUE(text.ok());
  return text.ok() ? *text : std::string();
}

/// The motion of a hand: goes along the surface normal to `depth_m` within `seconds`, rests for half of that
/// time, and comes out. The path is `aside_m` to the side.
struct LessonHand {
  double depth_m = 0.02, seconds = 2, aside_m = 0;
};

/// Returns the view of the profile's scene. Its focus is the surface point above the first target.
inline SceneView viewOfProfile(const std::string& json) {
  auto profile = parseProfile(json, "sample");
  EXPECT_TRUE(profile.ok());
  auto view = sceneViewOf(*profile);
  EXPECT_TRUE(view.ok());
  return *view;
}

inline Quat axisAlong(Vec3 z) {
  // the shortest rotation of +z onto z
  const Vec3 axis = cross({0, 0, 1}, z);
  const double c = z.z;
  if (c < -0.999999) return {1, 0, 0, 0};
  return normalized(Quat{axis.x, axis.y, axis.z, 1 + c});
}

/// Returns the lesson's samples at 1 kHz with the engine's forces, and its description.
/// It begins so many minutes after the others.
inline pb::SessionInfo lessonInfo(const std::string& profile_json, const std::string& trainee = "tina",
                                  std::int64_t minutes = 0) {
  pb::SessionInfo info;
  pb::SessionDescription& d = *info.mutable_description();
  const Uuid id = makeUuidV7();
  d.set_session_id(id.data(), id.size());
  d.set_station("bench-1");
  d.set_trainee(trainee);
  d.set_exercise_id("shoulder-bursa");
  const auto profile = parseProfile(profile_json, "sample");
  if (profile.ok()) d.set_profile_id(profile->id());
  d.set_profile_json(profile_json);
  d.set_engine_version("test");
  d.set_rate_hz(1000);
  d.set_started_unix_ns(1'763'685'600'000'000'000 + minutes * 60'000'000'000);
  auto& r = *d.mutable_resolution();
  r.set_length_m(1e-6);
  r.set_quaternion(0x1p-15);
  r.set_force_n(1e-3);
  r.set_torque_nm(1e-4);
  r.set_time_s(1e-6);
  r.set_speed_m_s(1e-4);
  info.set_state(pb::SESSION_COMPLETE);
  return info;
}

inline std::vector<GestureSample> lessonSamples(const std::string& profile_json, const LessonHand& hand) {
  const auto profile = parseProfile(profile_json, "sample");
  const auto spec = sceneSpecOf(*profile);
  const auto model = compile(*spec, 1000);
  const SceneView view = viewOfProfile(profile_json);
  const Vec3 n = view.focus_normal_W;
  Vec3 side = cross(n, {1, 0, 0});
  if (norm(side) < 0.1) side = cross(n, {0, 1, 0});
  side = normalized(side);
  const auto state = std::make_unique<SimState>();
  StepReport report;
  std::vector<GestureSample> samples(static_cast<std::size_t>(2.5 * hand.seconds * 1000));
  const auto ease = [](double s) {
    s = std::min(1.0, std::max(0.0, s));
    return s * s * s * (10 + s * (6 * s - 15));
  };
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const double t = static_cast<double>(k) / 1000;
    const double share = ease(t / hand.seconds) - ease((t - 1.5 * hand.seconds) / hand.seconds);
    const double depth = -0.01 + (hand.depth_m + 0.01) * share;
    const Vec3 p = view.focus_W_m - depth * n + hand.aside_m * share * side;
    const Quat q = axisAlong(-n);
    step(*model, {p, q}, *state, report);
    GestureSample& s = samples[k];
    s.tick = k;
    s.time_ns = 1'000'000'000 + static_cast<std::int64_t>(k) * 1'000'000;
    s.p_WT_m[0] = p.x, s.p_WT_m[1] = p.y, s.p_WT_m[2] = p.z;
    s.q_WT[0] = q.x, s.q_WT[1] = q.y, s.q_WT[2] = q.z, s.q_WT[3] = q.w;
    s.force_W_N[0] = report.wrench_W.force_N.x, s.force_W_N[1] = report.wrench_W.force_N.y;
    s.force_W_N[2] = report.wrench_W.force_N.z;
    s.insertion_m = report.insertion_m;
    s.speed_mps = report.speed_mps;
    s.lateral_error_m = report.lateral_error_m;
    s.layer = static_cast<std::int8_t>(report.layer);
    s.phase = static_cast<std::uint8_t>(report.phase);
    s.flags = report.flags;
    s.wall_W_m[0] = report.p_wall_W_m.x, s.wall_W_m[1] = report.p_wall_W_m.y,
    s.wall_W_m[2] = report.p_wall_W_m.z;
  }
  return samples;
}

inline std::shared_ptr<const StoredGesture> lesson(const LessonHand& hand = {},
                                                   const std::string& profile = "shoulder-adult") {
  const std::string json = sampleProfile(profile);
  return gestureOf(lessonInfo(json), lessonSamples(json, hand));
}

}  // namespace needlelab::test
