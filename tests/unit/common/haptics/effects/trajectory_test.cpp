// The line of an insertion: its length, how the hand leads it near the skin and changes it deeper
// (FORCE_MODEL.md, "Contact", "Near the skin", "Change of trajectory").
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/haptics/scene_model.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

SceneSpec softTissue() {
  SceneSpec scene = withClamping(oneLayer(1, 0.3, 0.1), ClampingMode::kConservative);
  scene.layers[0].lateral_stiffness_N_per_m2 = 7600;
  scene.layers[0].friction_N_per_m = 15;
  scene.effects = kAxial | bitOf(Effect::kClamping) | bitOf(Effect::kShaftFriction);
  scene.needle_length_m = 0.09;
  return scene;
}

double degreesBetween(Vec3 a, Vec3 b) {
  return std::atan2(norm(cross(a, b)), dot(a, b)) / kDegree;
}

/// A needle moved along straight lines between places, in the frame of a site on any limb.
class Hand {
 public:
  Hand(const SceneSpec& scene, const Site& site, Vec3 axis) : run_(scene, 1000), site_(site), axis_(axis) {
    p_ = site.p_surface_m - axis * 0.004;
    run_.step({p_, pointing(axis_)});
  }
  StepReport to(Vec3 p_m, double speed_mps = 0.02) {
    const int ticks = std::max(1, static_cast<int>(norm(p_m - p_) / speed_mps * 1000));
    const Vec3 from = p_;
    for (int i = 1; i <= ticks; ++i) {
      p_ = from + (p_m - from) * (static_cast<double>(i) / ticks);
      last_ = run_.step({p_, pointing(axis_)});
      greatest_N_ = std::max(greatest_N_, last_.clamping_N);
    }
    return last_;
  }
  /// Turns the axis without moving.
  void aim(Vec3 axis, double seconds) {
    const Vec3 from = axis_;
    const int ticks = static_cast<int>(seconds * 1000);
    for (int i = 1; i <= ticks; ++i) {
      axis_ = normalized(from + (axis - from) * (static_cast<double>(i) / ticks));
      last_ = run_.step({p_, pointing(axis_)});
    }
  }
  [[nodiscard]] Vec3 place() const { return p_; }
  [[nodiscard]] const StepReport& last() const { return last_; }
  [[nodiscard]] double greatest_N() const { return greatest_N_; }
  [[nodiscard]] const SimState& state() const { return run_.state(); }

 private:
  EngineRun run_;
  Site site_;
  Vec3 axis_, p_;
  StepReport last_;
  double greatest_N_ = 0;
};

TEST(Trajectory, aStraightNeedleHasItsTrueLengthInEveryLimb) {
  for (const LimbKind kind : kLimbKinds)
    for (const double degrees : {0.0, 20.0, 45.0, 60.0, 75.0, 79.99, 80.0}) {
      const SceneSpec scene = withLimb(softTissue(), kind);
      const Site site = siteOf(kind);
      const Vec3 axis = tilted(site.inward, std::tan(degrees * kDegree), site.across_2);
      const double reach = kind == LimbKind::kSphere || kind == LimbKind::kCapsule
                               ? std::min(0.05, 0.06 * std::cos(degrees * kDegree))
                               : 0.05;
      Hand hand(scene, site, axis);
      double before = 0;
      for (double way = 0.001; way < reach; way += 0.001) {
        const StepReport report = hand.to(site.p_surface_m + axis * way);
        ASSERT_NEAR(report.insertion_m, way, 1e-8) << limbName(kind) << ", " << degrees << " degrees";
        ASSERT_GT(report.insertion_m, before);
        ASSERT_NEAR(report.friction_N, -15 * way, 1e-6);
        ASSERT_LT(report.clamping_N, 1e-6);
        before = report.insertion_m;
      }
    }
}

// needles a hundredth of a degree apart are the same needle
TEST(Trajectory, theDirectionOfEntryHasNoJump) {
  for (double degrees = 0; degrees < 180; degrees += 0.5) {
    const auto direction = [&](double at) {
      EngineRun run(softTissue(), 1000);
      const Vec3 axis{std::sin(at * kDegree), 0, -std::cos(at * kDegree)};
      run.step({{0, 0, 1e-5}, pointing(axis)});
      run.step({{0, 0, -1e-5}, pointing(axis)});
      return run.state().u_W;
    };
    EXPECT_LE(degreesBetween(direction(degrees), direction(degrees + 0.01)), 0.0101) << degrees;
  }
}

// paper: near the skin the change is free within α
TEST(Trajectory, atFiveMillimetresAChangeOfTwentyDegreesFollowsTheHand) {
  const Site site = defaultSite();
  Hand hand(softTissue(), site, site.inward);
  hand.to(site.p_surface_m + site.inward * 0.0045);
  const Vec3 aim = tilted(site.inward, std::tan(20 * kDegree), site.across_1);
  hand.aim(aim, 0.3);
  hand.to(site.p_surface_m + aim * 0.0049, 0.005);
  EXPECT_LE(degreesBetween(hand.state().u_W, aim), 0.5);
  EXPECT_LE(hand.greatest_N(), 0.3);
  hand.to(site.p_surface_m + aim * 0.035);
  EXPECT_LE(hand.greatest_N(), 0.3) << "and it continues along the new line";
}

// the angle about the hole from which u turns is β, at every depth: tan β = 1e-4 + (d/L)²
TEST(Trajectory, theFreedomToReAimFallsWithDepth) {
  const SceneSpec scene = softTissue();
  const Site site = defaultSite();
  for (const double depth_m : {0.002, 0.006, 0.01, 0.015, 0.02, 0.03, 0.0449, 0.05, 0.07}) {
    const double beta = std::atan(1e-4 + std::pow(depth_m / scene.needle_length_m, 2)) / kDegree;
    for (const double degrees : {0.98 * beta, beta + 0.2}) {
      Hand hand(scene, site, site.inward);
      hand.to(site.p_surface_m + site.inward * depth_m);
      const Vec3 u_before = hand.state().u_W;
      const Vec3 aim = tilted(site.inward, std::tan(degrees * kDegree), site.across_1);
      hand.aim(aim, 0.3);
      hand.to(site.p_surface_m + aim * depth_m);
      hand.to(hand.place() + aim * 1e-9, 1e-9);
      EXPECT_EQ(hand.state().u_W == u_before, degrees < beta) << depth_m << " m, " << degrees;
    }
  }
}

// drawn back to just inside or just outside, the needle starts a new insertion elsewhere
TEST(Trajectory, drawnBackToTheSkinTheNeedleIsFree) {
  for (const LimbKind kind : kLimbKinds) {
    const Site site = siteOf(kind);
    double force_N[2];
    for (const bool inside : {false, true}) {
      Hand hand(withLimb(softTissue(), kind), site, site.inward);
      hand.to(site.p_surface_m + site.inward * 0.03);
      const Vec3 at = site.p_surface_m + site.inward * (inside ? 0.0005 : -0.001);
      hand.to(at);
      const Vec3 aim = tilted(site.inward, std::tan(20 * kDegree), site.across_1);
      hand.aim(aim, 0.5);
      force_N[inside ? 1 : 0] = hand.to(at + aim * 0.03).clamping_N;
    }
    EXPECT_NEAR(force_N[0], force_N[1], 0.1) << limbName(kind);
  }
}

// Fig. 10 of the paper: in, partly out, another direction, in
TEST(Trajectory, theHandChangesALineThatItPartlyLeft) {
  const Site site = defaultSite();
  Hand hand(softTissue(), site, site.inward);
  hand.to(site.p_surface_m + site.inward * 0.03);
  hand.to(site.p_surface_m + site.inward * 0.004);
  const Vec3 aim = tilted(site.inward, std::tan(15 * kDegree), site.across_1);
  hand.aim(aim, 0.3);
  hand.to(site.p_surface_m + aim * 0.0045, 0.005);
  hand.to(site.p_surface_m + aim * 0.035);
  EXPECT_NEAR(degreesBetween(hand.state().u_W, site.inward), 15, 1.5);
}

// no step where a needle far aside comes out
TEST(Trajectory, aNeedleHeldFarAsideComesOutWithoutAStep) {
  for (const LimbKind kind : kLimbKinds)
    for (const double aside : {0.003, 0.01, 0.02}) {
      const Site site = siteOf(kind);
      EngineRun run(withLimb(softTissue(), kind), 1000);
      const auto at = [&](double depth, double across) {
        return site.p_surface_m + site.inward * depth + site.across_1 * across;
      };
      MotionBuilder path(1000, at(-0.003, 0), site.inward);
      path.slideTo(at(0.015, 0), 0.02).slideTo(at(0.015, aside), 0.02).slideTo(at(-0.004, aside), 0.01);
      StepReport before{};
      double out_N = 0, worst_N = 0;
      for (const TipSample& sample : path.samples()) {
        const StepReport now = run.step(sample);
        if ((now.flags & kFlagExit) != 0) out_N = norm(before.wrench_W.force_N);
        if (before.layer >= 0 && now.layer >= 0)
          worst_N = std::max(worst_N, norm(now.wrench_W.force_N - before.wrench_W.force_N));
        before = now;
      }
      EXPECT_LE(out_N, 0.02) << limbName(kind) << ", " << aside;
      EXPECT_LE(worst_N, 0.06) << limbName(kind) << ", " << aside;
    }
}

// a finger, a wrist and a ball, run through aside: 2.30 N within a tick before
TEST(Trajectory, aNeedleRunThroughARoundLimbFarAsideDoesNotStep) {
  SceneSpec scene = softTissue();
  scene.needle_length_m = 0.016;
  scene.effects |= bitOf(Effect::kHub);
  scene.stage_numbers[stageOf(Effect::kHub)][kHubStiffness_N_per_m] = 300;
  for (const double radius_m : {0.008, 0.013, 0.03})
    for (const bool is_ball : {true, false})
      for (const double deep_m : {0.6, 1.1, 1.5})
        for (const double aside_m : {0.6, 1.2, 2.0}) {
          const Vec3 middle{0, 0, -radius_m};
          if (is_ball)
            scene.limb = SphereLimb{middle, radius_m};
          else
            scene.limb = CapsuleLimb{middle - Vec3{0, 0.1, 0}, middle + Vec3{0, 0.1, 0}, radius_m};
          const Vec3 axis = tilted({0, 0, -1}, std::tan(20 * kDegree), {1, 0, 0});
          EngineRun run(scene, 1000);
          const auto model = compiled(scene, 1000);
          const double springs_N_per_m =
              model.axialStiffness_N_per_m() + model.fixture_steepness.across_N_per_m;
          MotionBuilder path(1000, axis * -0.003, axis);
          const Vec3 deep = axis * (deep_m * radius_m), aside = deep + Vec3{aside_m * radius_m, 0, 0};
          path.slideTo(deep, 0.02).slideTo(aside, 0.02).slideTo(aside + Vec3{0, 0, -2 * radius_m}, 0.02);
          path.slideTo(aside, 0.02).slideTo(deep, 0.02);
          StepReport before{};
          Vec3 tip_before;
          double beyond_N = 0;
          for (const TipSample& sample : path.samples()) {
            const StepReport now = run.step(sample);
            constexpr std::uint32_t kReleases = kFlagExit | kFlagEntry | kFlagLayerChange | kFlagRupture;
            if (before.phase != Phase::kFree && (now.flags & kReleases) == 0)
              beyond_N = std::max(beyond_N, norm(now.wrench_W.force_N - before.wrench_W.force_N) -
                                                springs_N_per_m * norm(sample.p_WT_m - tip_before));
            before = now;
            tip_before = sample.p_WT_m;
          }
          EXPECT_LE(beyond_N, 0.02) << radius_m << (is_ball ? " ball, " : " capsule, ") << deep_m << ", "
                                    << aside_m;
        }
}

}  // namespace
}  // namespace needlelab::test
