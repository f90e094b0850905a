/// A hand's plans in a body: as in a sphere of the same skin, and where the depth is no exact distance.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "client/device/hand/hand_options.h"
#include "client/device/hand/hand_plan.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/surface.h"

namespace needlelab {
namespace {

constexpr double kSkinRadius_m = 0.05;
const Pose kBodyInW{{0.1, 0.05, -0.02}, normalized(Quat{0.3, 0.1, -0.2, 0.9})};

/// A ball of skin with its top at the origin of L. `steepness`: of its depth, 1 for a distance.
class BallBody final : public Body {
 public:
  explicit BallBody(double steepness) : steepness_(steepness) {}
  [[nodiscard]] double depth(Vec3 p_m) const noexcept override {
    return steepness_ * (kSkinRadius_m - norm(p_m - kCenter));
  }
  [[nodiscard]] Vec3 normal(Vec3 p_m) const noexcept override {
    const Vec3 out = p_m - kCenter;
    return norm(out) > 0 ? normalized(out) : Vec3{};
  }
  [[nodiscard]] StructureIndex structureAt(Vec3 p_m) const noexcept override {
    return depth(p_m) > 0 ? StructureIndex{0} : kOutside;
  }
  [[nodiscard]] LayerStack layersAlong(Vec3 /*from_m*/, Vec3 /*axis*/, double /*reach_m*/,
                                       double /*min_layer_m*/, AtBone /*at_bone*/) const noexcept override {
    return {};
  }
  [[nodiscard]] std::shared_ptr<const Bones> bonesIn(Vec3 /*center_m*/, double /*radius_m*/) const override {
    return nullptr;
  }
  [[nodiscard]] std::shared_ptr<const Surroundings> around(Vec3 /*center_m*/,
                                                           double /*radius_m*/) const override {
    return nullptr;
  }

  static constexpr Vec3 kCenter{0, 0, -kSkinRadius_m};

 private:
  double steepness_;
};

Limb ballBody(double steepness) {
  return BodyLimb{std::make_shared<BallBody>(steepness), kBodyInW};
}
const Limb kSphereLike = SphereLimb{kBodyInW * BallBody::kCenter, kSkinRadius_m};

TEST(BodyPlan, isThatInASphereOfTheSameSkin) {
  const PlanStyle style;
  for (const Vec3 target_L : {Vec3{0.01, -0.02, -0.03}, Vec3{0, 0, -0.01}, Vec3{-0.03, 0.01, -0.06}})
    for (const bool retries : {false, true}) {
      const Vec3 target = kBodyInW * target_L;
      const HandPlan expected =
          retries ? retryPlan(kSphereLike, target, 0.3, style) : targetPlan(kSphereLike, target, style);
      const HandPlan found =
          retries ? retryPlan(ballBody(1), target, 0.3, style) : targetPlan(ballBody(1), target, style);
      ASSERT_NEAR(found.duration_s(), expected.duration_s(), 1e-9);
      for (double t = 0; t < expected.duration_s(); t += 0.05)
        EXPECT_NEAR(norm(found.at(t).X_WT.p - expected.at(t).X_WT.p), 0, 1e-9);
    }
}

TEST(BodyPlan, goesThroughTheSkinWhereDepthIsNoDistance) {
  const PlanStyle style;
  const Limb body = ballBody(0.8);
  const Vec3 target = kBodyInW * Vec3{0.01, -0.02, -0.03};
  const HandPlan plan = targetPlan(body, target, style);
  const Vec3 axis = zAxis(plan.start().X_WT.q), entry = plan.start().X_WT.p + axis * style.approach_m;
  // a fifth of the error remains after each of nine steps
  EXPECT_NEAR(signedDepth(kSphereLike, entry), 0, 2e-8);
  double nearest_m = 1;
  for (double t = 0; t < plan.duration_s(); t += 0.01)
    nearest_m = std::min(nearest_m, norm(plan.at(t).X_WT.p - target));
  EXPECT_LT(nearest_m, 1e-12);
  EXPECT_NEAR(norm(nearestSkin(body, target, {0, 0, -1}) - entry), 0, 1e-8);
}

TEST(BodyPlan, startsAboveTheBodysOriginWithoutATarget) {
  SceneSpec scene;
  scene.limb = ballBody(1);
  scene.layers.resize(12);
  for (LayerSpec& layer : scene.layers) layer.thickness_m = 0.01;
  HandOptions options;
  options.plan = "depth";
  options.speed_mps = 0.02;
  options.hold_s = 1;
  options.repeat = 1;
  const auto plan = choosePlan(options, scene, {});
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  double deepest_m = 0;
  for (double t = 0; t < plan->duration_s(); t += 0.01)
    deepest_m = std::max(deepest_m, signedDepth(scene.limb, plan->at(t).X_WT.p));
  EXPECT_NEAR(deepest_m, 0.5 * scene.needle_length_m, 1e-9) << "structures have no thickness";
  const Vec3 start_L = inverse(kBodyInW) * plan->start().X_WT.p;
  EXPECT_NEAR(norm(Vec3{start_L.x, start_L.y, 0}), 0, 1e-9);
  EXPECT_EQ(markedEntry(scene.limb, kBodyInW), kBodyInW.p);
}

}  // namespace
}  // namespace needlelab
