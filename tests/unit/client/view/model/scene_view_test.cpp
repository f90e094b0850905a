#include "client/view/model/scene_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "common/haptics/scene_model.h"
#include "tests/support/anatomy/ball_profiles.h"
#include "tests/support/random.h"
#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab {
namespace {

const char* const kProfiles[] = {"shoulder-adult", "knee-adult",   "lumbar-adult",
                                 "finger-adult",   "phantom-ball", "paper-1dof"};

TEST(Hazards, areAsFarOffAPlaneAsTheirNearestPoint) {
  const PicturePlane plane{{0, 0, 0.1}, {0, 0, 1}};
  struct Row {
    const char* name;
    double a_z_m, b_z_m, off_m;
  };
  for (const Row& row :
       {Row{"a ball behind", 0.09, 0.09, -0.008}, Row{"a ball in front", 0.11, 0.11, 0.008},
        Row{"a ball that the plane cuts", 0.1015, 0.1015, 0}, Row{"a line through the plane", 0.05, 0.15, 0},
        Row{"a line that comes near", 0.05, 0.095, -0.003}}) {
    const HazardView hazard{"h", pb::Hazard::NERVE, {0.3, 0, row.a_z_m}, {0, -0.2, row.b_z_m}, 0.002};
    EXPECT_NEAR(offPlane_m(hazard, plane), row.off_m, 1e-12) << row.name;
  }
}

TEST(Hazards, fadeByHalfForEvery8MillimetresOffThePlane) {
  for (const double off_m : {0.0, 0.001, -0.0009}) EXPECT_EQ(offPlaneOpacity(off_m), 1);
  for (int halves = 1; halves < 6; ++halves)
    for (const double side : {1.0, -1.0})
      EXPECT_NEAR(offPlaneOpacity(side * (0.001 + 0.008 * halves)), std::pow(0.5, halves), 1e-12);
}

TEST(Hazards, sayHowFarOffThePlaneTheyAre) {
  const HazardView nerve{"nerve", pb::Hazard::NERVE, {}, {}, 0.002};
  EXPECT_EQ(hazardLabel(nerve, 0), "nerve");
  EXPECT_EQ(hazardLabel(nerve, -0.001), "nerve");
  EXPECT_EQ(hazardLabel(nerve, -0.0082), "nerve, 8 mm behind");
  EXPECT_EQ(hazardLabel(nerve, 0.0078), "nerve, 8 mm in front");
}

TEST(SceneView, depthsAndLayersAreTheEngines) {
  test::Random draw(5);
  for (const char* name : kProfiles) {
    const test::SampleLesson lesson = test::sampleLesson(name);
    const SceneView& scene = *lesson.scene;
    ASSERT_EQ(scene.layers.size(), lesson.model->layer_count) << name;
    for (int i = 0; i < 300; ++i) {
      const Vec3 p =
          scene.focus_W_m + Vec3{draw.in(-1, 1), draw.in(-1, 1), draw.in(-1, 1)} * (0.8 * scene.extent_m);
      const double depth_m = depthInLimb(*lesson.model, p);
      ASSERT_NEAR(depthAt(scene, p), depth_m, 1e-12) << name;
      int expected = -1;
      for (std::uint32_t k = 0; k < lesson.model->layer_count; ++k)
        if (depth_m > 0 && depth_m >= lesson.model->layers[k].top_m) expected = static_cast<int>(k);
      ASSERT_EQ(layerAt(scene, depth_m), expected) << name << " at " << depth_m;
    }
  }
}

TEST(SceneView, everythingMovesWithThePlacement) {
  const Pose X_WL{{0.1, -0.2, 0.3}, normalized(Quat{0.2, 0.4, -0.1, 0.8})};
  for (const char* name : kProfiles) {
    const test::SampleLesson lesson = test::sampleLesson(name);
    const auto placed = sceneViewOf(lesson.profile, X_WL);
    ASSERT_TRUE(placed) << placed.error().message;
    const SceneView &before = *lesson.scene, &after = *placed;
    EXPECT_NEAR(norm(after.focus_W_m - X_WL * before.focus_W_m), 0, 1e-9) << name;
    EXPECT_NEAR(norm(after.focus_normal_W - rotate(X_WL.q, before.focus_normal_W)), 0, 1e-9) << name;
    EXPECT_NEAR(after.extent_m, before.extent_m, 1e-9);
    for (std::size_t i = 0; i < before.targets.size(); ++i)
      EXPECT_NEAR(norm(after.targets[i].center_W_m - X_WL * before.targets[i].center_W_m), 0, 1e-9);
    for (std::size_t i = 0; i < before.hazards.size(); ++i) {
      EXPECT_NEAR(norm(after.hazards[i].a_W_m - X_WL * before.hazards[i].a_W_m), 0, 1e-9);
      EXPECT_NEAR(norm(after.hazards[i].b_W_m - X_WL * before.hazards[i].b_W_m), 0, 1e-9);
    }
    const Vec3 p = before.focus_W_m - before.focus_normal_W * 0.004;
    EXPECT_NEAR(depthAt(after, X_WL * p), depthAt(before, p), 1e-9);
  }
}

TEST(SceneView, theFocusLiesOnTheSkinAboveTheTarget) {
  for (const char* name : kProfiles) {
    const test::SampleLesson lesson = test::sampleLesson(name);
    const SceneView& scene = *lesson.scene;
    EXPECT_NEAR(depthAt(scene, scene.focus_W_m), 0, 1e-9) << name;
    EXPECT_NEAR(norm(scene.focus_normal_W), 1, 1e-12);
    ASSERT_FALSE(scene.targets.empty());
    EXPECT_NEAR(norm(cross(scene.focus_W_m - scene.targets[0].center_W_m, scene.focus_normal_W)), 0, 1e-9)
        << name;
    EXPECT_GE(scene.extent_m, 0.01);
  }
}

TEST(SceneView, layersHaveTheProfilesNames) {
  const test::SampleLesson lumbar = test::sampleLesson("lumbar-adult");
  std::vector<std::string> names;
  for (const LayerView& layer : lumbar.scene->layers) names.push_back(layer.name);
  EXPECT_EQ(names, (std::vector<std::string>{"skin", "subcutaneous fat", "interspinous ligament",
                                             "ligamentum flavum", "epidural space", "dura and vertebra"}));
  EXPECT_EQ(layerName(*lumbar.scene, -1), "outside");
  EXPECT_EQ(layerName(*lumbar.scene, 3), "ligamentum flavum");
  EXPECT_EQ(layerName(*lumbar.scene, 99), "?");
  EXPECT_TRUE(lumbar.scene->layers[3].has_membrane);
  // a profile may have no names
  pb::Profile unnamed = lumbar.profile;
  for (pb::Layer& layer : *unnamed.mutable_layers()) layer.clear_name();
  const auto before = sceneViewOf(unnamed);
  ASSERT_TRUE(before.ok());
  EXPECT_EQ(layerName(*before, 3), "tendon 2");
  // A round limb is filled by its last layer.
  const test::SampleLesson shoulder = test::sampleLesson("shoulder-adult");
  EXPECT_DOUBLE_EQ(shoulder.scene->layers.back().bottom_m, 0.06);
}

TEST(SceneView, distancesToHazardsAreFromTheirSurfaceToTheShaft) {
  HazardView hazard{"nerve", pb::Hazard::NERVE, {-1, 0.01, -0.02}, {1, 0.01, -0.02}, 0.002};
  EXPECT_NEAR(distanceToHazard_m(hazard, {0, 0, -0.03}, {0, 0, 0}), 0.008, 1e-12);  // passes beside it
  EXPECT_NEAR(distanceToHazard_m(hazard, {0, 0, -0.01}, {0, 0, 0}), std::hypot(0.01, 0.01) - 0.002, 1e-12);
  EXPECT_LT(distanceToHazard_m(hazard, {0, 0.01, -0.03}, {0, 0.01, 0}), 0);
}

TEST(PlanView, goesFromBeforeTheSkinToBeyondTheTargetAlongThePlan) {
  for (const char* name : kProfiles) {
    const test::SampleLesson lesson = test::sampleLesson(name);
    const SceneView& scene = *lesson.scene;
    const Vec3 oblique = normalized(-scene.focus_normal_W + Vec3{0.3, -0.2, 0.1});
    const PlannedLine line{scene.focus_W_m, oblique};
    const PlanView view = planViewOf(scene, line);
    EXPECT_NEAR(distanceFrom(line, view.from_W_m), 0, 1e-12) << name;
    EXPECT_NEAR(distanceFrom(line, view.to_W_m), 0, 1e-12) << name;
    const double before_m = dot(line.entry_m - view.from_W_m, oblique),
                 behind_m = dot(view.to_W_m - line.entry_m, oblique);
    EXPECT_NEAR(before_m, 0.5 * scene.needle.length_m, 1e-12) << name;
    EXPECT_GE(behind_m, scene.needle.length_m - 1e-12) << name;
    for (const TargetView& target : scene.targets)
      EXPECT_GT(behind_m, dot(target.center_W_m - line.entry_m, oblique)) << name;
    EXPECT_EQ(view.entry_W_m, line.entry_m) << name;
  }
}

TEST(PlanView, anObliqueLineGoesOnBeyondItsTarget) {
  // a plane at 0 with a target 26 mm deep; at 60° to the normal the path to it is twice as long: 52 mm
  constexpr double kDeep_m = 0.026, kWay_m = 2 * kDeep_m;
  SceneView scene;
  scene.limb_W = PlaneLimb{{0, 0, 0}, {0, 0, 1}};
  scene.needle.length_m = 0.038;
  const Vec3 middle{0, 0, -kDeep_m};
  scene.targets.push_back({"bursa", middle, 0.003, middle, {0, 0, 1}, kDeep_m - 0.003, kDeep_m + 0.003});
  const Vec3 direction{std::sqrt(0.75), 0, -0.5};
  const PlannedLine line{{-kWay_m * std::sqrt(0.75), 0, 0}, direction};
  EXPECT_NEAR(norm(planViewOf(scene, line).to_W_m - line.entry_m), 1.15 * kWay_m, 1e-12);
  // a longer needle reaches farther
  scene.needle.length_m = 0.09;
  EXPECT_NEAR(norm(planViewOf(scene, line).to_W_m - line.entry_m), 0.09, 1e-12);
}

TEST(PlanView, isTheExercisesPlanOnTheLimbForThatPatientOnly) {
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  // a quarter turn about y: the limb's z is W's x
  const auto scene = sceneViewOf(lesson.profile, {{0.1, 0.2, 0.3}, {0, std::sqrt(0.5), 0, std::sqrt(0.5)}});
  ASSERT_TRUE(scene.ok());
  pb::Exercise exercise;
  exercise.set_profile_id("shoulder-adult");
  EXPECT_FALSE(planViewOf(*scene, exercise)) << "no plan";
  exercise.mutable_plan()->set_frame(pb::Exercise::Plan::LIMB);
  exercise.mutable_plan()->mutable_entry_m()->set_x(0.01);
  exercise.mutable_plan()->mutable_direction()->set_z(-2);
  const auto view = planViewOf(*scene, exercise);
  ASSERT_TRUE(view);
  EXPECT_NEAR(norm(view->entry_W_m - Vec3{0.1, 0.2, 0.29}), 0, 1e-12);
  EXPECT_NEAR(norm(normalized(view->to_W_m - view->entry_W_m) - Vec3{-1, 0, 0}), 0, 1e-12);
  exercise.set_profile_id("knee-adult");
  EXPECT_FALSE(planViewOf(*scene, exercise)) << "the line would lie in another limb";
}

TEST(PlanView, aRingLiesOnTheSkinAboutTheEntry) {
  SceneView scene;
  scene.extent_m = 0.1;
  scene.needle.length_m = 0.05;
  for (const Vec3 normal : {Vec3{0, 0, 1}, Vec3{1, 0, 0}, Vec3{0, -1, 0}, normalized(Vec3{1, 2, -3})}) {
    scene.limb_W = PlaneLimb{{0.01, 0.02, 0.03}, normal};
    const PlannedLine line{{0.01, 0.02, 0.03}, normalized(-normal + Vec3{0.1, 0.2, 0.05})};
    const PlanView view = planViewOf(scene, line);
    ASSERT_GE(view.ring_W_m.size(), 16u);
    Vec3 sum;
    for (const Vec3 corner_W_m : view.ring_W_m) {
      EXPECT_NEAR(norm(corner_W_m - line.entry_m), 0.0045, 1e-12) << "0.045 of the scene's extent";
      EXPECT_NEAR(depthAt(scene, corner_W_m), 0, 1e-12) << "in the skin's plane, not across the line";
      sum = sum + (corner_W_m - line.entry_m);
    }
    EXPECT_NEAR(norm(sum), 0, 1e-12) << "all around";
  }
}

TEST(SceneView, refusesAnInvalidProfileOrPlacement) {
  EXPECT_FALSE(sceneViewOf(pb::Profile{}));
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  EXPECT_FALSE(sceneViewOf(lesson.profile, {{std::numeric_limits<double>::quiet_NaN(), 0, 0}, {}}));
  EXPECT_FALSE(sceneViewOf(lesson.profile, {{0, 0, 0}, {0, 0, 0, 3}}));
}

TEST(SceneView, aNeedleOfUnknownThicknessIsDrawnAllTheSame) {
  const test::SampleLesson paper = test::sampleLesson("paper-six-layers");
  EXPECT_EQ(paper.scene->needle.outer_diameter_m, 0);
  EXPECT_DOUBLE_EQ(drawnDiameter_m(*paper.scene), 0.0008);
  const test::SampleLesson shoulder = test::sampleLesson("shoulder-adult");
  EXPECT_DOUBLE_EQ(drawnDiameter_m(*shoulder.scene), 0.0007);  // 22 gauge
}

TEST(AidSet, keepsAidsAndReturnsThemInOrder) {
  AidSet aids;
  aids.set(pb::Exercise::ULTRASOUND, true);
  aids.set(pb::Exercise::PHASE, true);
  aids.set(pb::Exercise::FORCE, true);
  aids.set(pb::Exercise::FORCE, false);
  EXPECT_TRUE(aids.has(pb::Exercise::PHASE));
  EXPECT_FALSE(aids.has(pb::Exercise::FORCE));
  const AidList list = aids.list();
  ASSERT_EQ(list.size(), 2);
  EXPECT_EQ(list.Get(0), pb::Exercise::PHASE);
  EXPECT_EQ(list.Get(1), pb::Exercise::ULTRASOUND);
  EXPECT_EQ(AidSet(list), aids);
}

TEST(AidSet, passesOverNumbersThatAreNoAid) {
  AidList list;
  list.Add(999);
  list.Add(pb::Exercise::AID_UNSPECIFIED);
  list.Add(pb::Exercise::DEPTH);
  AidSet depth;
  depth.set(pb::Exercise::DEPTH, true);
  EXPECT_EQ(AidSet(list), depth);
}

TEST(AidSet, usualIsAllButTheUltrasoundPictureAndTheSteps) {
  AidSet all = allAidSet();
  EXPECT_TRUE(all.has(pb::Exercise::ULTRASOUND));
  all.set(pb::Exercise::ULTRASOUND, false);
  all.set(pb::Exercise::STEPS, false);
  EXPECT_EQ(all, usualAidSet());
}

TEST(AidSet, everyAidHasItsOwnWords) {
  std::set<std::string_view> words;
  for (const int aid : allAidSet().list()) words.insert(aidWord(static_cast<pb::Exercise::Aid>(aid)));
  EXPECT_EQ(words.size(), static_cast<std::size_t>(allAidSet().list().size()));
  EXPECT_FALSE(words.contains("unknown aid"));
}

TEST(SceneView, depthIsTheDistanceBelowTheSurfaceOfEachShape) {
  test::Random draw(31);
  const auto anywhere = [&](double reach) {
    return Vec3{draw.in(-reach, reach), draw.in(-reach, reach), draw.in(-reach, reach)};
  };
  for (int round = 0; round < 60; ++round) {
    SceneView scene;
    const Vec3 a = anywhere(0.1), b = anywhere(0.1), p = anywhere(0.15);
    const double radius_m = draw.in(0.02, 0.08);
    scene.limb_W = SphereLimb{a, radius_m};
    EXPECT_NEAR(depthAt(scene, p), radius_m - std::hypot(p.x - a.x, p.y - a.y, p.z - a.z), 1e-12);
    const Vec3 out = normalized(b);
    scene.limb_W = PlaneLimb{a, out};
    EXPECT_NEAR(depthAt(scene, p), out.x * (a.x - p.x) + out.y * (a.y - p.y) + out.z * (a.z - p.z), 1e-12);
    // a capsule, compared with the nearest of many balls along its axis
    scene.limb_W = CapsuleLimb{a, b, radius_m};
    constexpr int kBalls = 4000;
    double nearest_m = 1;
    for (int i = 0; i <= kBalls; ++i)
      nearest_m = std::min(nearest_m, norm(p - (a + (b - a) * (static_cast<double>(i) / kBalls))));
    EXPECT_NEAR(depthAt(scene, p), radius_m - nearest_m, norm(b - a) / kBalls);
  }
}

TEST(SceneView, aLayerBeginsAtItsTopAndTheLastHasNoEnd) {
  SceneView scene;
  scene.layers.resize(3);
  const std::vector<double> bottoms_m = {0.002, 0.01, 0.03};
  for (std::size_t i = 0; i < 3; ++i) {
    scene.layers[i].name = std::to_string(i);
    scene.layers[i].top_m = i == 0 ? 0 : bottoms_m[i - 1];
    scene.layers[i].bottom_m = bottoms_m[i];
  }
  scene.layer_end_m = bottoms_m;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const std::vector<std::pair<double, int>> rows = {{-1, -1},
                                                    {0, -1},
                                                    {1e-9, 0},
                                                    {0.0019, 0},
                                                    {0.002, 1},
                                                    {0.00999, 1},
                                                    {0.01, 2},
                                                    {0.03, 2},
                                                    {kInfinity, 2},
                                                    {-kInfinity, -1},
                                                    {std::numeric_limits<double>::quiet_NaN(), -1}};
  for (const auto& [depth_m, layer] : rows) EXPECT_EQ(layerAt(scene, depth_m), layer) << depth_m;
}

TEST(SceneView, ofAVolumeIsThatOfTheBallOfLayers) {
  const Pose X_WL{{0.3, -0.1, 0.2}, normalized(Quat{0.1, -0.4, 0.2, 0.8})};
  const auto like = sceneViewOf(test::readProfile(test::ballOfLayers()), X_WL),
             found = sceneViewOf(test::readProfile(test::ballOfRules()), X_WL);
  ASSERT_TRUE(like.ok() && found.ok());
  ASSERT_EQ(found->layers.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(found->layers[i].name, like->layers[i].name);
    EXPECT_EQ(found->layers[i].kind, like->layers[i].kind);
    EXPECT_EQ(found->layers[i].cutting_N, like->layers[i].cutting_N);
  }
  const NeedleLine line = lineToTarget(*found);
  const TissuesOnLine along = tissuesOnLine(*found, line, 0.03), alike = tissuesOnLine(*like, line, 0.03);
  ASSERT_EQ(along.tissues.size(), 3U);
  ASSERT_EQ(alike.tissues.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(along.tissues[i].top_m, alike.tissues[i].top_m, 2e-4);
  EXPECT_NEAR(norm(found->focus_W_m - X_WL.p), 0, 1e-8) << "where the skin is at the profile's origin";
  EXPECT_NEAR(norm(found->targets[0].middle_W_m - like->targets[0].middle_W_m), 0, 1e-6);
  test::Random random(9);
  for (int i = 0; i < 500; ++i) {
    const double x = random.in(-0.03, 0.03), y = random.in(-0.03, 0.03), z = random.in(-0.045, 0.005);
    const Vec3 p = X_WL * Vec3{x, y, z};
    EXPECT_EQ(layerAt(*found, p), layerAt(*like, p));
    EXPECT_EQ(layerAt(*like, p), layerAt(*like, depthAt(*like, p)));
  }
}

TEST(SceneView, measuresAHazardThatIsAStructureByItsSurface) {
  const auto scene = sceneViewOf(test::readProfile(test::withCyst()));
  ASSERT_TRUE(scene.ok());
  ASSERT_EQ(scene->hazards.size(), 1U);
  const Vec3 beside = test::kCyst_m + Vec3{0.006, 0, 0};
  EXPECT_NEAR(distanceToHazard_m(scene->hazards[0], beside, beside), 0.006 - test::kCystRadius_m, 1e-9);
  EXPECT_LE(distanceToHazard_m(scene->hazards[0], beside - Vec3{0.012, 0, 0}, beside), 0);
}

}  // namespace
}  // namespace needlelab
