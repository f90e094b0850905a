/// Moves a needle through a scene tick by tick, for tests that predict by formula.
#pragma once

#include <cmath>
#include <numbers>

#include "tests/unit/common/haptics/runs.h"

namespace needlelab::test {

inline constexpr double kDegree = std::numbers::pi / 180;

/// The needle at a site. Coordinates: the depth along the site's inward direction and two lateral distances.
class Probe {
 public:
  Probe(const SceneSpec& spec, double rate_hz, const Site& site = defaultSite())
      : run_(spec, rate_hz), rate_hz_(rate_hz), site_(site), axis_(site.inward) {}

  /// Runs one tick at this place with the current axis.
  StepReport at(double depth_m, double aside_1_m = 0, double aside_2_m = 0) {
    depth_ = depth_m;
    aside_1_ = aside_1_m;
    aside_2_ = aside_2_m;
    last_ = run_.step({point(), pointing(axis_)});
    return last_;
  }
  /// Moves there in a straight line at constant speed in this many ticks. Returns the report of every tick.
  std::vector<StepReport> go(int ticks, double depth_m, double aside_1_m = 0, double aside_2_m = 0) {
    const double from = depth_, from_1 = aside_1_, from_2 = aside_2_;
    std::vector<StepReport> reports;
    for (int i = 1; i <= ticks; ++i) {
      const double s = static_cast<double>(i) / ticks;
      reports.push_back(at(from + (depth_m - from) * s, from_1 + (aside_1_m - from_1) * s,
                           from_2 + (aside_2_m - from_2) * s));
    }
    return reports;
  }
  std::vector<StepReport> stay(int ticks) { return go(ticks, depth_, aside_1_, aside_2_); }
  /// Sets the needle's axis (unit vector).
  void point(Vec3 axis) { axis_ = axis; }
  /// Tilts the axis by this many radians from the inward direction toward the first lateral direction.
  void tilt(double angle_rad) {
    axis_ = site_.inward * std::cos(angle_rad) + site_.across_1 * std::sin(angle_rad);
  }

  [[nodiscard]] Vec3 point() const {
    return site_.p_surface_m + site_.inward * depth_ + site_.across_1 * aside_1_ + site_.across_2 * aside_2_;
  }
  [[nodiscard]] const StepReport& last() const { return last_; }
  [[nodiscard]] const SimState& state() const { return run_.state(); }
  [[nodiscard]] const SceneModel& model() const { return run_.model(); }
  [[nodiscard]] const Site& site() const { return site_; }
  [[nodiscard]] double rate_hz() const { return rate_hz_; }

 private:
  EngineRun run_;
  double rate_hz_;
  Site site_;
  Vec3 axis_;
  double depth_ = 0, aside_1_ = 0, aside_2_ = 0;
  StepReport last_;
};

/// One layer of practically unlimited depth with the given axial forces; stiffness 500 N/m; no effects
/// listed.
inline SceneSpec oneLayer(double cutting_N, double attracted_N, double rejection_N) {
  SceneSpec scene = paperOneDof();
  scene.layers[0].cutting_force_N = cutting_N;
  scene.layers[0].attracted_force_N = attracted_N;
  scene.layers[0].rejection_force_N = rejection_N;
  scene.effects = 0;
  return scene;
}

inline constexpr EffectMask kAxial = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted);

}  // namespace needlelab::test
