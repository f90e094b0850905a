#include "client/device/hand_plan_choice.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "client/device/skilled_hand.h"
#include "common/haptics/scene_model.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

SceneSpec scene() {
  SceneSpec spec;
  spec.layers.resize(2);
  spec.layers[0].thickness_m = 0.01;
  spec.layers[1].thickness_m = 0.03;
  return spec;
}
const std::vector<PlanTarget> kTargets = {{"bursa", {0.01, 0, -0.02}}, {"joint space", {0, 0.01, -0.03}}};

double deepest(const HandPlan& plan) {
  double depth = -1;
  for (double t = 0; t < plan.duration_s(); t += 0.002) depth = std::max(depth, -plan.at(t).X_WT.p.z);
  return depth;
}
Result<HandPlan> choose(const std::string& words, const std::vector<PlanTarget>& targets = kTargets) {
  HandOptions options;
  options.plan = words;
  return choosePlan(options, scene(), targets);
}

TEST(ChoosePlan, findsTargetsByName) {
  EXPECT_NEAR(deepest(*choose("target")), 0.02, 1e-9);
  EXPECT_NEAR(deepest(*choose("target:joint space")), 0.03, 1e-9);
  EXPECT_NEAR(deepest(*choose("retry:bursa")), 0.02, 1e-6);
}

TEST(ChoosePlan, aSkillMakesAnAttemptOfItsOwnByWayOfTheMarkedEntry) {
  HandOptions options;
  options.skill = 1;
  const std::vector<PlanTarget> oblique = {{"joint", {0.01, 0, -0.02}, Vec3{0, 0, 0}}};
  std::size_t different = 0;
  double tilt = 0;
  for (options.seed = 1; options.seed <= 20; ++options.seed) {
    const auto by_entry = choosePlan(options, scene(), oblique),
               straight = choosePlan(options, scene(), kTargets);
    ASSERT_TRUE(by_entry.ok() && straight.ok());
    EXPECT_GT(deepest(*by_entry), 0.019);
    EXPECT_LT(deepest(*by_entry), 0.022) << "an expert overshoots by little";
    // the needle's axis in W, hub to tip
    const Vec3 axis = rotate(by_entry->start().X_WT.q, Vec3{0, 0, 1});
    tilt += std::atan2(axis.x, -axis.z) / 20;
    different += by_entry->duration_s() != straight->duration_s();
  }
  EXPECT_NEAR(tilt, std::atan2(0.01, 0.02), 0.03);
  EXPECT_GT(different, 0u);
  options.seed = 3;
  EXPECT_EQ(choosePlan(options, scene(), oblique)->duration_s(),
            choosePlan(options, scene(), oblique)->duration_s());
}

TEST(ChoosePlan, theMarkedEntryIsTheFramesOriginOnTheSurface) {
  const Limb plane = PlaneLimb{{0, 0, 0}, {0, 0, 2}};
  EXPECT_EQ(markedEntry(plane, Pose{}), Vec3());
  EXPECT_EQ(markedEntry(plane, Pose{{0.1, 0.2, 0}, {}}), (Vec3{0.1, 0.2, 0}));
  EXPECT_FALSE(markedEntry(plane, Pose{{0, 0, 0.001}, {}}).has_value());
}

TEST(ChoosePlan, withoutTargetsGoesToHalfOfTheLayers) {
  EXPECT_NEAR(deepest(*choose("target", {})), 0.02, 1e-9);
  EXPECT_NEAR(deepest(*choose("depth")), 0.02, 1e-9);
  EXPECT_NEAR(deepest(*choose("depth:0.035")), 0.035, 1e-9);
}

TEST(ChoosePlan, aPlanThatIsDoneAgainFillsItsSyringeAnew) {
  HandOptions options;
  options.aspirate = true;
  const auto once = choosePlan(options, scene(), kTargets);
  EXPECT_EQ(once->end().plunger, 1);
  options.repeat = 0;
  const auto again = choosePlan(options, scene(), kTargets);
  EXPECT_EQ(again->end().plunger, again->start().plunger);
  EXPECT_EQ(again->end().X_WT, again->start().X_WT);
  EXPECT_LT(again->end().X_WT.p.z, 0.1);
  EXPECT_GT(again->end().X_WT.p.z, 0) << "outside the tissue";
}

TEST(ChoosePlan, restStaysOutside) {
  const auto plan = choose("rest");
  EXPECT_NEAR(deepest(*plan), -0.02, 1e-12);
  EXPECT_EQ(plan->duration_s(), 2);
}

TEST(ChoosePlan, refusesWhatItDoesNotKnowByName) {
  const struct {
    const char *words, *part;
  } rows[] = {{"target:hip", "'bursa', 'joint space'"},
              {"retry:hip", "no target 'hip'"},
              {"depth:deep", "'deep'"},
              {"depth:-0.01", "'-0.01'"},
              {"depth:nan", "'nan'"},
              {"/nowhere/plan.csv", "/nowhere/plan.csv"},
              {"depth:0.01x", "'0.01x'"}};
  for (const auto& row : rows) {
    const auto plan = choose(row.words);
    ASSERT_FALSE(plan.ok()) << row.words;
    EXPECT_EQ(plan.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(plan.error().message, HasSubstr(row.part));
  }
  const auto outside = choose("target", {{"above", {0, 0, 0.01}}});
  ASSERT_FALSE(outside.ok());
  EXPECT_THAT(outside.error().message, HasSubstr("'above' is not inside the limb"));
}

TEST(ChoosePlan, takesAFileOfPoses) {
  const auto path = std::filesystem::temp_directory_path() / "needlelab_hand_plan_test.csv";
  std::ofstream(path) << "t_s,px_m,py_m,pz_m,qx,qy,qz,qw,plunger\n10,0,0,0.1,1,0,0,0,0\n"
                         "11,0,0,-0.01,1,0,0,0,0.5\n11,0,0,-0.01,1,0,0,0,0.5\n13,0,0,0.05,1,0,0,0,1\n";
  HandOptions options;
  options.plan = path.string();
  const auto once = choosePlan(options, scene(), {});
  options.repeat = 2;
  const auto twice = choosePlan(options, scene(), {});
  std::ofstream(path) << "t_s,px_m,py_m,pz_m,qx,qy,qz,qw\n10,0,0,0.1,1,0,0,0\n";
  const auto single = choosePlan(options, scene(), {});
  std::filesystem::remove(path);

  ASSERT_TRUE(once.ok()) << once.error().message;
  EXPECT_NEAR(once->duration_s(), 3, 1e-12);
  EXPECT_NEAR(once->at(0.5).X_WT.p.z, 0.045, 1e-12);
  EXPECT_NEAR(once->at(2).X_WT.p.z, 0.02, 1e-12);
  EXPECT_NEAR(once->at(2).plunger, 0.75, 1e-12);
  // done again, it first goes back to its start
  ASSERT_TRUE(twice.ok());
  EXPECT_EQ(twice->end().X_WT, twice->start().X_WT);
  EXPECT_EQ(twice->end().plunger, 0);
  ASSERT_FALSE(single.ok());
  EXPECT_THAT(single.error().message, HasSubstr("at least two rows"));
}

TEST(ChoosePlan, checksSpeedAndHold) {
  for (const double bad : {0.0, -1.0, 1e3, std::numeric_limits<double>::quiet_NaN()}) {
    HandOptions options;
    options.speed_mps = bad;
    EXPECT_FALSE(choosePlan(options, scene(), kTargets).ok());
    options = {};
    options.hold_s = bad;
    EXPECT_FALSE(choosePlan(options, scene(), kTargets).ok());
  }
}

}  // namespace
}  // namespace needlelab
