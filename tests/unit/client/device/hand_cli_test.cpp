#include "client/device/hand_cli.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace needlelab {
namespace {

// CLI11 takes the arguments in reverse
void parse(HandOptions& options, const std::vector<std::string>& arguments) {
  CLI::App app;
  addHandOptions(app, options);
  app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
}

TEST(HandCli, aPersonAspiratesUnlessAskedNotTo) {
  HandOptions o;
  EXPECT_FALSE(o.aspirate);
  parse(o, {});
  EXPECT_TRUE(o.aspirate);
  parse(o, {"--hand-no-aspirate"});
  EXPECT_FALSE(o.aspirate);
  parse(o, {"--hand-aspirate"});
  EXPECT_TRUE(o.aspirate);
}

TEST(HandCli, aSkillSetsTremorAndSpeed) {
  HandOptions beginner, expert;
  parse(beginner, {"--hand-skill", "0"});
  parse(expert, {"--hand-skill", "1"});
  EXPECT_EQ(beginner.skill, 0);
  EXPECT_EQ(expert.skill, 1);
  EXPECT_GT(beginner.tremor_m, expert.tremor_m);
  EXPECT_LT(beginner.speed_mps, expert.speed_mps);
  EXPECT_EQ(beginner.stiffness_N_per_m, expert.stiffness_N_per_m);
  HandOptions o;
  EXPECT_FALSE(o.skill.has_value());
  for (const char* const level : {"-0.1", "1.1", "nan", "much"})
    EXPECT_THROW(parse(o, {"--hand-skill", level}), CLI::ValidationError) << level;
  // one of them says what the hand is like, not both
  EXPECT_THROW(parse(o, {"--hand-skill", "0.5", "--hand-tremor-m", "1e-4"}), CLI::ExcludesError);
  EXPECT_THROW(parse(o, {"--hand-speed-m-s", "0.03", "--hand-skill", "0.5"}), CLI::ExcludesError);
}

TEST(HandCli, everyOptionReachesItsField) {
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

TEST(HandCli, withoutOptionsIsTheDefaultHandThatCorrectsItself) {
  HandOptions o;
  parse(o, {});
  EXPECT_EQ(HandOptions{}.correction_per_s, 0);
  EXPECT_EQ(o.correction_per_s, kCommandLineCorrection_per_s);
  EXPECT_EQ(o.stiffness_N_per_m, 300);
  EXPECT_EQ(o.damping_Ns_per_m, 3);
  EXPECT_EQ(o.plan, "target");
}

TEST(HandCli, valuesOutOfRangeAreRefusedWithTheRange) {
  for (const char* name :
       {"--hand-speed-m-s", "--hand-hold-s", "--hand-tremor-m", "--hand-stiffness", "--hand-damping",
        "--hand-rotational-stiffness", "--hand-rotational-damping", "--hand-correction"})
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

}  // namespace
}  // namespace needlelab
