#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "client/device/hand/hand_options.h"
#include "common/haptics/scene_model.h"

namespace needlelab {
namespace {

// CLI11 takes the arguments in reverse
void parse(HandOptions& options, const std::vector<std::string>& arguments) {
  CLI::App app;
  addHandOptions(app, options);
  app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
}

TEST(HandOptions, aPersonAspiratesUnlessAskedNotTo) {
  HandOptions o;
  EXPECT_FALSE(o.aspirate);
  parse(o, {});
  EXPECT_TRUE(o.aspirate);
  parse(o, {"--hand-no-aspirate"});
  EXPECT_FALSE(o.aspirate);
  parse(o, {"--hand-aspirate"});
  EXPECT_TRUE(o.aspirate);
}

TEST(HandOptions, aSkillSetsTremorSpeedAndBracing) {
  HandOptions beginner, expert;
  parse(beginner, {"--hand-skill", "0"});
  parse(expert, {"--hand-skill", "1"});
  EXPECT_EQ(beginner.skill, 0);
  EXPECT_EQ(expert.skill, 1);
  EXPECT_GT(beginner.tremor_m, expert.tremor_m);
  EXPECT_LT(beginner.speed_mps, expert.speed_mps);
  EXPECT_EQ(beginner.bracing_N_per_m, 0);
  EXPECT_EQ(expert.bracing_N_per_m, kBracing_N_per_m);
  HandOptions o;
  EXPECT_FALSE(o.skill.has_value());
  for (const char* const level : {"-0.1", "1.1", "nan", "much"})
    EXPECT_THROW(parse(o, {"--hand-skill", level}), CLI::ValidationError) << level;
  // only one of the two options may describe the hand
  EXPECT_THROW(parse(o, {"--hand-skill", "0.5", "--hand-tremor-m", "1e-4"}), CLI::ExcludesError);
  EXPECT_THROW(parse(o, {"--hand-speed-m-s", "0.03", "--hand-skill", "0.5"}), CLI::ExcludesError);
}

TEST(HandOptions, everyOptionReachesItsField) {
  HandOptions o;
  parse(o, {"--hand-plan",
            "retry:joint space",
            "--hand-speed-m-s",
            "0.03",
            "--hand-hold-s",
            "4",
            "--hand-repeat",
            "0",
            "--hand-tremor-m",
            "1e-4",
            "--hand-seed",
            "18446744073709551615",
            "--hand-stiffness",
            "150",
            "--hand-damping",
            "2",
            "--hand-rotational-stiffness",
            "1",
            "--hand-rotational-damping",
            "0.1",
            "--hand-correction",
            "0.5"});
  EXPECT_EQ(o.plan, "retry:joint space");
  EXPECT_EQ(o.speed_mps, 0.03);
  EXPECT_EQ(o.hold_s, 4);
  EXPECT_EQ(o.repeat, 0u);
  EXPECT_EQ(o.tremor_m, 1e-4);
  EXPECT_EQ(o.seed, 18446744073709551615u);
  EXPECT_EQ(o.stiffness_N_per_m, 150);
  EXPECT_EQ(o.damping_Ns_per_m, 2);
  EXPECT_EQ(o.rotational_stiffness_Nm_per_rad, 1);
  EXPECT_EQ(o.rotational_damping_Nms_per_rad, 0.1);
  EXPECT_EQ(o.correction_per_s, 0.5);
}

TEST(HandOptions, withoutOptionsIsABracedHandThatCorrectsItself) {
  HandOptions o;
  parse(o, {});
  EXPECT_EQ(HandOptions{}.correction_per_s, 0);
  EXPECT_EQ(o.correction_per_s, kCommandLineCorrection_per_s);
  EXPECT_EQ(o.bracing_N_per_m, kBracing_N_per_m);
}

TEST(HandOptions, valuesOutOfRangeAreRefusedWithTheRange) {
  for (const char* name :
       {"--hand-speed-m-s", "--hand-hold-s", "--hand-tremor-m", "--hand-stiffness", "--hand-damping",
        "--hand-bracing", "--hand-rotational-stiffness", "--hand-rotational-damping", "--hand-correction"})
    for (const char* value : {"-1", "1e9", "nan", "inf", "many", ""}) {
      HandOptions o;
      try {
        parse(o, {std::string(name) + "=" + value});
        ADD_FAILURE() << name << " took " << value;
      } catch (const CLI::ParseError& e) {
        EXPECT_NE(std::string(e.what()).find(name), std::string::npos) << e.what();
      }
    }
  HandOptions o;
  EXPECT_THROW(parse(o, {"--hand-speed-m-s", "0"}), CLI::ParseError);
  EXPECT_THROW(parse(o, {"--hand-seed=-1"}), CLI::ParseError);
}

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

TEST(ChoosePlan, aSkilledAttemptVariesAndPassesTheMarkedEntry) {
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

TEST(ChoosePlan, aRepeatedPlanRefillsItsSyringe) {
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

TEST(ChoosePlan, refusesUnknownOptionsByName) {
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
                         "11,0,0,-0.01,1,0,0,0,0.5\n13,0,0,0.05,1,0,0,0,1\n";
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
  // To repeat, it first returns to its start.
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
