/// A gesture as functions of continuous time. It can be sampled at any rate; a score must not depend on the
/// rate.
#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {

/// Two insertions into halfSpace(): the first is abandoned and turned back, the second reaches the target.
/// With tremor, a leaning shaft, lateral force, aspiration and injection. The seed sets speeds, depths and
/// tremor.
class ContinuousGesture {
 public:
  explicit ContinuousGesture(std::uint64_t seed) {
    std::mt19937_64 random(seed);
    // uses the generator's raw bits, because distributions differ between libraries
    const auto uniform = [&](double low, double high) {
      return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
    };
    first_depth_m_ = uniform(0.008, 0.014);
    target_depth_m_ = uniform(0.022, 0.028);
    in_s_ = uniform(1.2, 2.4);
    lean_rad_ = uniform(0.05, 0.2);
    aside_m_ = uniform(0.002, 0.006);
    tremor_m_ = uniform(2e-5, 2e-4);
    for (double& phase : phases_) phase = uniform(0, 2 * std::numbers::pi);
  }

  [[nodiscard]] double duration_s() const { return 9 + 2 * in_s_; }
  [[nodiscard]] Vec3 target() const { return {0, aside_m_, -target_depth_m_ + 0.0005}; }

  [[nodiscard]] pb::Profile profile() const {
    pb::Profile profile = halfSpace();
    addTarget(profile, target(), 0.003);
    addBallHazard(profile, "artery", {0, -0.006, -0.009}, 0.0062);
    return profile;
  }

  void fill(double t, GestureSample& s) const {
    // 20 mm above, in, abandoned and turned, withdrawn, to the side, in to the target, rest, out
    const double a = in_s_, depth_m = -0.02 + (0.02 + first_depth_m_) * ease(t - 0.5, a) -
                                      (0.01 + first_depth_m_) * ease(t - a - 2, 1) +
                                      (0.01 + target_depth_m_) * ease(t - a - 3.5, a) -
                                      (0.02 + target_depth_m_) * ease(t - 2 * a - 6.5, 1.5);
    const double aside_m = aside_m_ * ease(t - a - 2, 1.4),
                 lean = lean_rad_ * (ease(t - a - 1, 0.8) - ease(t - a - 2, 1.4));
    const auto tremor = [&](int axis) {
      return tremor_m_ *
             std::sin(2 * std::numbers::pi * (9 + axis) * t + phases_[static_cast<std::size_t>(axis)]);
    };
    const Vec3 tip{tremor(0), aside_m + tremor(1), -depth_m + tremor(2)};
    const double depth = -tip.z;
    setDepth(s, depth);
    setTip(s, tip);
    setDown(s, lean);
    const bool inside = depth > 0;
    s.plunger = 0.3 - 0.15 * ease(t - 2 * a - 3.8, 0.5) + 0.6 * ease(t - 2 * a - 4.8, 1);
    s.lateral_error_m = inside ? 1e-3 * std::abs(std::sin(t)) : 0;
    if (!inside) return;
    s.force_W_N[2] = 40 * depth + 0.3 * s.layer;
    s.force_W_N[1] = -150 * (tip.y - aside_m) - 200 * 0.02 * lean;
    // The phase follows the planned speed, because the engine's hysteresis ignores tremor.
    const bool out = (t > a + 2 && t < a + 3) || t > 2 * a + 6.5;
    const bool in = (t > 0.5 && t < a + 0.5) || (t > a + 3.5 && t < 2 * a + 3.5);
    s.phase = static_cast<std::uint8_t>(out ? Phase::kWithdrawing : in ? Phase::kInserting : Phase::kStopped);
    if (t > a + 1 && t < a + 1.8) s.flags |= kFlagTurn;
  }

  [[nodiscard]] std::vector<GestureSample> samples(double rate_hz) const {
    auto list = gesture(rate_hz, duration_s(), [this](double t, GestureSample& s) { fill(t, s); });
    bool was_inside = false;
    for (GestureSample& s : list) {
      if (s.layer >= 0 && !was_inside) s.flags |= kFlagEntry;
      was_inside = s.layer >= 0;
    }
    return list;
  }

 private:
  double first_depth_m_ = 0, target_depth_m_ = 0, in_s_ = 0, lean_rad_ = 0, aside_m_ = 0, tremor_m_ = 0;
  std::array<double, 3> phases_{};
};

/// A plan for these gestures: 4 mm beside the first entry, leaning by 6.4°.
inline pb::Exercise plannedExercise() {
  pb::Exercise exercise;
  auto& plan = *exercise.mutable_plan();
  plan.set_frame(pb::Exercise::Plan::LIMB);
  plan.mutable_entry_m()->set_x(0.002);
  plan.mutable_entry_m()->set_y(-0.003);
  plan.mutable_entry_m()->set_z(0);
  plan.mutable_direction()->set_x(0.05);
  plan.mutable_direction()->set_y(0.1);
  plan.mutable_direction()->set_z(-1);
  return exercise;
}

}  // namespace needlelab
