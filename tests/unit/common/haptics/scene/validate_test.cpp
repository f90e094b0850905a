// validate(): refuses every number of a scene that is out of range, naming its path, value and range.
#include "common/haptics/scene_spec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "common/haptics/scene_model.h"
#include "tests/support/scenes/scenes.h"

namespace needlelab::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

struct Field {
  std::string path;
  std::string range;  ///< in the notation of db/samples/README.md
  double most;        ///< greatest allowed
  bool zero_allowed;
  std::function<double&(SceneSpec&)> in;
};

std::vector<Field> fields() {
  return {
      {"needle.length_m", "(0, 1]", 1, false, [](SceneSpec& s) -> double& { return s.needle_length_m; }},
      {"layers[2].thickness_m", "(0, 1]", 1, false,
       [](SceneSpec& s) -> double& { return s.layers[2].thickness_m; }},
      {"layers[0].cutting_force_n", "[0, 50]", 50, true,
       [](SceneSpec& s) -> double& { return s.layers[0].cutting_force_N; }},
      {"layers[5].attracted_force_n", "[0, 50]", 50, true,
       [](SceneSpec& s) -> double& { return s.layers[5].attracted_force_N; }},
      {"layers[1].rejection_force_n", "[0, 50]", 50, true,
       [](SceneSpec& s) -> double& { return s.layers[1].rejection_force_N; }},
      {"layers[3].lateral_stiffness_n_per_m2", "[0, 1", 1e7, true,
       [](SceneSpec& s) -> double& { return s.layers[3].lateral_stiffness_N_per_m2; }},
      {"layers[4].friction_n_per_m", "[0, 1", 1e4, true,
       [](SceneSpec& s) -> double& { return s.layers[4].friction_N_per_m; }},
      {"layers[0].puncture.linear_n_per_m", "[0, ", 1e5, true,
       [](SceneSpec& s) -> double& { return s.layers[0].membrane->linear_N_per_m; }},
      {"layers[0].puncture.quadratic_n_per_m2", "[0, ", 1e9, true,
       [](SceneSpec& s) -> double& { return s.layers[0].membrane->quadratic_N_per_m2; }},
      {"layers[0].puncture.force_n", "(0, 50]", 50, false,
       [](SceneSpec& s) -> double& { return s.layers[0].membrane->force_N; }},
      {"tracking_wall.stiffness_n_per_m", "(0, 1", 1e4, false,
       [](SceneSpec& s) -> double& { return s.tracking_wall.stiffness_N_per_m; }},
      {"tracking_wall.stop_speed_m_s", "(0, 0.1]", 0.1, false,
       [](SceneSpec& s) -> double& { return s.tracking_wall.stop_speed_mps; }},
      {"tracking_wall.stop_dwell_s", "(0, 10]", 10, false,
       [](SceneSpec& s) -> double& { return s.tracking_wall.stop_dwell_s; }},
      {"tracking_wall.stop_duration_s", "(0, 10]", 10, false,
       [](SceneSpec& s) -> double& { return s.tracking_wall.stop_duration_s; }},
      {"tracking_wall.relax_time_s", "(0, 60]", 60, false,
       [](SceneSpec& s) -> double& { return s.tracking_wall.relax_time_s; }},
      {"tracking_wall.relax_residual", "[0, 1]", 1, true,
       [](SceneSpec& s) -> double& { return s.tracking_wall.relax_residual; }},
      {"virtual_fixture.max_stiffness_n_per_m", "(0, 1", 1e4, false,
       [](SceneSpec& s) -> double& { return s.virtual_fixture.max_stiffness_N_per_m; }},
      {"virtual_fixture.max_force_n", "[0, 50]", 50, true,
       [](SceneSpec& s) -> double& { return s.virtual_fixture.max_force_N; }},
      {"orientation_limit.stiffness_nm_per_rad", "[0, 100]", 100, true,
       [](SceneSpec& s) -> double& { return s.orientation_limit.stiffness_Nm_per_rad; }},
      {"orientation_limit.max_torque_nm", "[0, 5]", 5, true,
       [](SceneSpec& s) -> double& { return s.orientation_limit.max_torque_Nm; }},
      {"shaft_friction.stiffness_n_per_m", "(0, 1", 1e4, false,
       [](SceneSpec& s) -> double& { return s.friction_stiffness_N_per_m; }},
      {"max_force_n", "(0, 50]", 50, false, [](SceneSpec& s) -> double& { return s.max_force_N; }},
  };
}

std::string refusal(const SceneSpec& scene) {
  const Status status = validate(scene);
  if (status.ok()) return "it was accepted";
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput);
  const auto model = compile(scene, 1000);
  EXPECT_FALSE(model.ok()) << "compile takes nothing that validate refuses";
  if (!model.ok()) {
    EXPECT_EQ(model.error().message, status.error().message);
  }
  return status.error().message;
}

TEST(Validate, theReadyMadeScenesAreValid) {
  for (const SceneSpec& scene : {paperOneDof(), paperSixLayers(), allEffects()})
    for (const LimbKind limb : kLimbKinds) {
      const Status status = validate(withLimb(scene, limb));
      EXPECT_TRUE(status.ok()) << status.error().message;
    }
}

TEST(Validate, outOfRangeFieldsAreRefusedByPathValueAndRange) {
  for (const Field& field : fields()) {
    const double inf = std::numeric_limits<double>::infinity();
    std::vector<std::pair<double, std::string>> bad = {
        {std::nan(""), "nan"},    {inf, "inf"},     {-inf, "-inf"}, {-1e-9, "-1e-09"}, {-3, "-3"},
        {field.most * 1.001, ""}, {1e300, "1e+300"}};
    if (!field.zero_allowed) bad.emplace_back(0.0, ": 0");
    for (const auto& [value, text] : bad) {
      SceneSpec scene = allEffects();
      field.in(scene) = value;
      EXPECT_THAT(refusal(scene), AllOf(HasSubstr(field.path), HasSubstr(text), HasSubstr(field.range)))
          << field.path << " = " << value;
    }
  }
}

TEST(Validate, theEndsOfTheRangesAreAllowed) {
  for (const Field& field : fields()) {
    SceneSpec scene = allEffects();
    for (auto& layer : scene.layers) layer.rejection_force_N = 0;
    field.in(scene) = field.most;
    // rejection has a second bound, tested below
    if (field.path.find("rejection") == std::string::npos) {
      EXPECT_TRUE(validate(scene).ok()) << field.path << " = " << field.most;
    }
    field.in(scene) = field.zero_allowed ? 0.0 : 1e-6;
    EXPECT_TRUE(validate(scene).ok()) << field.path << " at its lower end";
  }
}

TEST(Validate, layersAreOneToThirtyTwo) {
  SceneSpec scene = paperOneDof();
  const LayerSpec layer = scene.layers[0];
  scene.layers.clear();
  EXPECT_THAT(refusal(scene), AllOf(HasSubstr("layers"), HasSubstr("0"), HasSubstr("32")));
  scene.layers.assign(33, layer);
  EXPECT_THAT(refusal(scene), AllOf(HasSubstr("layers"), HasSubstr("33"), HasSubstr("32")));
  scene.layers.assign(32, layer);
  EXPECT_TRUE(validate(scene).ok());
}

// db/samples/README.md: "A layer's rejection force is at most its cutting force, and at most its attracted
// force if attraction is active."
TEST(Validate, rejectionIsAtMostWhatTheWallCanHold) {
  SceneSpec scene = paperSixLayers();  // attracted 0.4 everywhere
  scene.layers[3].rejection_force_N = 0.41;
  EXPECT_THAT(refusal(scene),
              AllOf(HasSubstr("layers[3].rejection_force_n"), HasSubstr("0.41"), HasSubstr("0.4")));
  scene.effects &= ~bitOf(Effect::kAttracted);
  EXPECT_TRUE(validate(scene).ok()) << "attracted is not live: cutting alone bounds it";
  scene.layers[3].rejection_force_N = 2.51;
  EXPECT_THAT(refusal(scene), HasSubstr("2.51"));
  scene.layers[3].rejection_force_N = 2.5;
  EXPECT_TRUE(validate(scene).ok());
}

TEST(Validate, aMembraneThatCouldNeverRuptureIsRefused) {
  SceneSpec scene = allEffects();
  scene.layers[2].membrane = MembraneSpec{0, 0, 1};
  EXPECT_THAT(refusal(scene), HasSubstr("layers[2].puncture"));
}

TEST(Validate, limbsWithoutAShapeAreRefused) {
  const double nan = std::nan("");
  const auto with = [](Limb limb) {
    SceneSpec scene = paperOneDof();
    scene.limb = limb;
    return scene;
  };
  EXPECT_THAT(refusal(with(PlaneLimb{{0, 0, 0}, {0, 0, 0}})), HasSubstr("limb.plane.normal"));
  EXPECT_THAT(refusal(with(PlaneLimb{{0, nan, 0}, {0, 0, 1}})), HasSubstr("limb.plane.point_m"));
  EXPECT_THAT(refusal(with(PlaneLimb{{0, 0, 0}, {0, HUGE_VAL, 1}})), HasSubstr("limb.plane.normal"));
  for (const double radius : {0.0, -0.1, nan, 1.01, HUGE_VAL}) {
    EXPECT_THAT(refusal(with(SphereLimb{{0, 0, 0}, radius})),
                AllOf(HasSubstr("limb.sphere.radius_m"), HasSubstr("(0, 1]")));
    EXPECT_THAT(refusal(with(CapsuleLimb{{0, 0, 0}, {0, 0, 1}, radius})), HasSubstr("limb.capsule.radius_m"));
  }
  EXPECT_THAT(refusal(with(SphereLimb{{nan, 0, 0}, 0.1})), HasSubstr("limb.sphere.center_m"));
  EXPECT_THAT(refusal(with(CapsuleLimb{{1, 2, 3}, {1, 2, 3}, 0.1})), HasSubstr("limb.capsule"));
  EXPECT_THAT(refusal(with(CapsuleLimb{{0, 0, nan}, {1, 2, 3}, 0.1})), HasSubstr("limb.capsule.a_m"));
  EXPECT_THAT(refusal(with(CapsuleLimb{{0, 0, 0}, {1, -HUGE_VAL, 3}, 0.1})), HasSubstr("limb.capsule.b_m"));
}

TEST(Validate, unknownEffectBitsAreRefused) {
  EXPECT_THAT(refusal(withEffects(paperOneDof(), EffectMask{1} << kEffectCount)), HasSubstr("effects"));
}

TEST(Compile, loopRatesOutOfRangeAreRefused) {
  for (const double rate : {0.0, -1000.0, 49.9, 40'001.0, std::nan(""), HUGE_VAL}) {
    const auto model = compile(paperOneDof(), rate);
    ASSERT_FALSE(model.ok()) << rate;
    EXPECT_EQ(model.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(model.error().message, HasSubstr("rate"));
  }
  EXPECT_TRUE(compile(paperOneDof(), 50).ok());
  EXPECT_TRUE(compile(paperOneDof(), 40'000).ok());
}

TEST(Placed, turnsAndMovesEveryShape) {
  const double half = std::sqrt(0.5);
  const Pose X{{1, 2, 3}, {half, 0, 0, half}};  // a quarter turn about x: y → z, z → −y
  const auto plane = std::get<PlaneLimb>(placed(PlaneLimb{{0, 0, 1}, {0, 0, 2}}, X));
  EXPECT_NEAR(norm(plane.point_m - Vec3{1, 1, 3}), 0, 1e-15);
  EXPECT_NEAR(norm(plane.normal - Vec3{0, -2, 0}), 0, 1e-15);
  const auto sphere = std::get<SphereLimb>(placed(SphereLimb{{0, 1, 0}, 0.3}, X));
  EXPECT_NEAR(norm(sphere.center_m - Vec3{1, 2, 4}), 0, 1e-15);
  EXPECT_EQ(sphere.radius_m, 0.3);
  const auto capsule = std::get<CapsuleLimb>(placed(CapsuleLimb{{1, 0, 0}, {0, 1, 0}, 0.2}, X));
  EXPECT_NEAR(norm(capsule.a_m - Vec3{2, 2, 3}), 0, 1e-15);
  EXPECT_NEAR(norm(capsule.b_m - Vec3{1, 2, 4}), 0, 1e-15);
}

}  // namespace
}  // namespace needlelab::test
