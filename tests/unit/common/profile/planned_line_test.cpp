#include "common/profile/planned_line.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "common/profile/profile.h"
#include "tests/unit/common/profile/good_profile.h"

namespace needlelab {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

const char* const kPlan =
    R"({"frame": "LIMB", "entry_m": {"x": 0, "y": 0, "z": 0}, "direction": {"x": 0, "y": 0, "z": -2}})";

/// Exercise "one" of the good course, with a plan.
Result<pb::Exercise> withPlan(const std::string& plan) {
  nlohmann::json exercise = nlohmann::json::parse(kGoodCurriculum)["exercises"][0];
  exercise["plan"] = nlohmann::json::parse(plan);
  return parseExercise(exercise.dump(), "e.json");
}

/// The good plan with another value at `pointer`; an empty value erases.
std::string planWith(const std::string& pointer, const std::string& value) {
  return mutated(kPlan, pointer, value);
}

pb::Profile profileOn(const std::string& limb) {
  nlohmann::json tree = nlohmann::json::parse(kGoodProfile);
  tree["limb"] = nlohmann::json::parse(limb);
  auto profile = parseProfile(tree.dump(), "p.json");
  EXPECT_TRUE(profile.ok()) << profile.error().message;
  return profile.ok() ? *profile : pb::Profile();
}

/// What checkPlan reports about a readable plan; empty: nothing.
std::string faultOn(const pb::Profile& profile, const std::string& plan) {
  const auto exercise = withPlan(plan);
  EXPECT_TRUE(exercise.ok()) << exercise.error().message;
  if (!exercise.ok()) return {};
  const Status status = checkPlan(*exercise, profile, "exercises[3]");
  if (status.ok()) return {};
  EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput);
  return status.error().message;
}

TEST(Plan, isReadAndWrittenBackTheSame) {
  for (const std::string& plan : {std::string(kPlan), mutated(planWith("/direction", ""), "/target_m",
                                                              R"({"x": 0.01, "y": 0, "z": -0.03})")}) {
    const auto exercise = withPlan(plan);
    ASSERT_TRUE(exercise.ok()) << exercise.error().message;
    EXPECT_EQ(nlohmann::json::parse(exerciseJson(*exercise))["plan"], nlohmann::json::parse(plan));
    const auto again = parseExercise(exerciseJson(*exercise), "again");
    ASSERT_TRUE(again.ok());
    EXPECT_EQ(exerciseJson(*again), exerciseJson(*exercise));
  }
  // an exercise without a plan is written as before
  const auto plain = parseCurriculum(kGoodCurriculum, "c");
  ASSERT_TRUE(plain.ok());
  EXPECT_EQ(exerciseJson(plain->exercises(0)).find("plan"), std::string::npos);
}

TEST(Plan, whatIsNoLineIsRefusedByField) {
  const struct {
    const char *pointer, *value, *expected;
  } kWrong[] = {
      {"/frame", "", "plan.frame: is missing"},
      {"/frame", "\"W\"", "plan.frame: \"W\" is not one of LIMB"},
      {"/frame", "\"FRAME_UNSPECIFIED\"", "plan.frame: \"FRAME_UNSPECIFIED\" is not one of LIMB"},
      {"/entry_m", "", "plan.entry_m: is missing"},
      {"/entry_m/y", "", "plan.entry_m.y: is missing"},
      {"/entry_m/x", "\"NaN\"", "plan.entry_m.x: must be a number, found the text \"NaN\""},
      {"/entry_m/x", "1001", "plan.entry_m.x: 1001 is out of range [-1000, 1000]"},
      {"/direction/z", "null", "plan.direction.z: must be a number, found null"},
      {"/direction/z", "0", "plan.direction: has the length 0: give any vector that points into the tissue"},
      {"/direction", "", "plan: give either direction or target_m; found neither"},
      {"/target_m", R"({"x": 0, "y": 0, "z": -0.03})", "plan: give either direction or target_m; found both"},
      {"/angle_rad", "1", "plan: unknown field \"angle_rad\"; known are frame, entry_m, direction, target_m"},
  };
  for (const auto& wrong : kWrong) {
    SCOPED_TRACE(std::string(wrong.pointer) + " = " + wrong.value);
    const auto exercise = withPlan(planWith(wrong.pointer, wrong.value));
    ASSERT_FALSE(exercise.ok());
    EXPECT_EQ(exercise.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(exercise.error().message, StartsWith(std::string("e.json: ") + wrong.expected));
  }
  const auto on_entry =
      withPlan(mutated(planWith("/direction", ""), "/target_m", R"({"x": 0, "y": 0, "z": 0})"));
  ASSERT_FALSE(on_entry.ok());
  EXPECT_THAT(on_entry.error().message,
              StartsWith("e.json: plan.target_m: is the same point as entry_m: give a point further along"));
  EXPECT_FALSE(
      withPlan(mutated(planWith("/direction", ""), "/target_m", R"({"x": 0, "y": 0, "z": -5e-7})")).ok())
      << "too near to give a direction";
  // JSON has no NaN
  EXPECT_FALSE(parseExercise(R"({"plan": {"entry_m": {"x": NaN}}})", "e.json").ok());
  // in a course the path names the exercise
  auto course = nlohmann::json::parse(kGoodCurriculum);
  course["exercises"][1]["plan"] = nlohmann::json::parse(planWith("/direction", ""));
  const auto parsed = parseCurriculum(course.dump(), "c.json");
  ASSERT_FALSE(parsed.ok());
  EXPECT_THAT(parsed.error().message, StartsWith("c.json: exercises[1].plan: give either"));
}

TEST(Plan, mustLieOnTheSkinOfItsProfile) {
  // 10 mm above a plane through z = 0.02; the normal is not a unit vector
  const pb::Profile plane =
      profileOn(R"({"plane": {"point_m": {"x": 0, "y": 0, "z": 0.02}, "normal": {"x": 0, "y": 0, "z": 5}}})");
  const auto at = [](const std::string& z) { return planWith("/entry_m/z", z); };
  EXPECT_EQ(faultOn(plane, at("0.02")), "");
  EXPECT_EQ(faultOn(plane, at("0.0209")), "") << "rounded by its author";
  EXPECT_EQ(faultOn(plane, at("0.0191")), "");
  EXPECT_EQ(faultOn(plane, at("0.03")),
            "exercises[3].plan.entry_m: (0, 0, 30) mm is 10 mm above the skin of profile 'shoulder-adult', "
            "allowed is 1 mm: the nearest point of the skin is (0, 0, 20) mm");
  EXPECT_THAT(faultOn(plane, at("0.018")), HasSubstr("(0, 0, 18) mm is 2 mm below the skin"));
  // a ball of 60 mm with its top at 0: straight above its centre, and at its centre
  const pb::Profile ball =
      profileOn(R"({"sphere": {"center_m": {"x": 0, "y": 0, "z": -0.06}, "radius_m": 0.06}})");
  EXPECT_EQ(faultOn(ball, kPlan), "");
  EXPECT_THAT(faultOn(ball, at("0.005")), HasSubstr("is 5 mm above"));
  EXPECT_THAT(faultOn(ball, at("-0.06")), HasSubstr("is 60 mm below"));
  // a capsule along x
  const pb::Profile capsule = profileOn(
      R"({"capsule": {"a_m": {"x": -0.1, "y": 0, "z": -0.04}, "b_m": {"x": 0.1, "y": 0, "z": -0.04}, "radius_m": 0.04}})");
  EXPECT_EQ(faultOn(capsule, kPlan), "");
  EXPECT_THAT(faultOn(capsule, planWith("/entry_m/x", "0.3")), HasSubstr("above the skin"));
}

TEST(Plan, mustGoIntoTheTissue) {
  const pb::Profile plane =
      profileOn(R"({"plane": {"point_m": {"x": 0, "y": 0, "z": 0}, "normal": {"x": 0, "y": 0, "z": 1}}})");
  // `degrees` below the skin's plane
  const auto at = [](double degrees) {
    const double a = degrees * std::numbers::pi / 180;
    return planWith("/direction",
                    nlohmann::json{{"x", 3 * std::cos(a)}, {"y", 0}, {"z", -3 * std::sin(a)}}.dump());
  };
  EXPECT_EQ(faultOn(plane, at(90)), "");
  EXPECT_EQ(faultOn(plane, at(10.1)), "");
  EXPECT_EQ(faultOn(plane, at(9)),
            "exercises[3].plan.direction: the line goes in at 9° to the skin of profile 'shoulder-adult': it "
            "has to go in at 10° to the skin or more");
  EXPECT_THAT(faultOn(plane, at(-90)), HasSubstr("plan.direction: the line comes out of the tissue at 90°"));
  // to a target: above the skin, and farther than the needle's 60 mm
  const auto to = [](const std::string& point) {
    return mutated(planWith("/direction", ""), "/target_m", point);
  };
  EXPECT_EQ(faultOn(plane, to(R"({"x": 0, "y": 0, "z": -0.06})")), "");
  EXPECT_THAT(faultOn(plane, to(R"({"x": 0, "y": 0, "z": 0.06})")),
              HasSubstr("exercises[3].plan.target_m: the line comes out of the tissue"));
  EXPECT_EQ(faultOn(plane, to(R"({"x": 0, "y": 0, "z": -0.08})")),
            "exercises[3].plan.target_m: is 80 mm from the entry, and the needle is 60 mm long");
  // the exercise's own needle counts
  auto longer = withPlan(to(R"({"x": 0, "y": 0, "z": -0.08})"));
  ASSERT_TRUE(longer.ok());
  longer->mutable_needle()->set_length_m(0.09);
  EXPECT_TRUE(checkPlan(*longer, plane, "").ok());
  longer->clear_plan();
  EXPECT_TRUE(checkPlan(*longer, plane, "").ok()) << "no plan, nothing to check";
}

TEST(PlannedLine, isPlacedAndNormalised) {
  const auto exercise = withPlan(planWith("/entry_m/x", "0.01"));
  ASSERT_TRUE(exercise.ok());
  // 90° about z, then moved: x becomes y; a caller's quaternion need not be normalised
  const Pose X{{1, 2, 3}, {0, 0, std::sqrt(2.0), std::sqrt(2.0)}};
  const auto line = plannedLineOf(*exercise, X);
  ASSERT_TRUE(line);
  EXPECT_NEAR(norm(line->entry_m - Vec3{1, 2.01, 3}), 0, 1e-15);
  EXPECT_NEAR(norm(line->direction - Vec3{0, 0, -1}), 0, 1e-15) << "of the length 2 in the plan";
  // the same line, given by its target
  const auto by_target = withPlan(mutated(mutated(planWith("/entry_m/x", "0.01"), "/direction", ""),
                                          "/target_m", R"({"x": 0.01, "y": 0, "z": -0.04})"));
  ASSERT_TRUE(by_target.ok());
  EXPECT_NEAR(norm(plannedLineOf(*by_target, X)->direction - line->direction), 0, 1e-15);
}

TEST(PlannedLine, itsDirectionMayHaveAnyLengthButNone) {
  for (const char* const z : {"-5e-7", "-1e-200", "-1000"}) {
    const auto exercise = withPlan(planWith("/direction/z", z));
    ASSERT_TRUE(exercise.ok()) << exercise.error().message;
    const auto line = plannedLineOf(*exercise);
    ASSERT_TRUE(line) << z;
    EXPECT_EQ(line->direction, (Vec3{0, 0, -1})) << z;
  }
}

TEST(PlannedLine, isAbsentWithoutALine) {
  pb::Exercise exercise;
  EXPECT_FALSE(plannedLineOf(exercise));
  // only in code: parseExercise refuses these
  exercise.mutable_plan()->mutable_entry_m();
  EXPECT_FALSE(plannedLineOf(exercise)) << "the target is absent, and so the entry itself";
  exercise.mutable_plan()->mutable_direction();
  EXPECT_FALSE(plannedLineOf(exercise)) << "of length 0";
  exercise.mutable_plan()->mutable_direction()->set_z(std::numeric_limits<double>::quiet_NaN());
  EXPECT_FALSE(plannedLineOf(exercise));
  exercise.mutable_plan()->mutable_direction()->set_z(std::numeric_limits<double>::infinity());
  EXPECT_FALSE(plannedLineOf(exercise));
  exercise.mutable_plan()->mutable_direction()->set_z(-1);
  EXPECT_TRUE(plannedLineOf(exercise));
  exercise.mutable_plan()->mutable_entry_m()->set_x(std::numeric_limits<double>::quiet_NaN());
  EXPECT_FALSE(plannedLineOf(exercise));
}

TEST(PlannedLine, measuresDistancesAndAngles) {
  const PlannedLine line{{0, 0, 0}, {0, 0, -1}};
  EXPECT_NEAR(distanceFrom(line, {0.003, 0.004, -0.02}), 0.005, 1e-15);
  EXPECT_NEAR(distanceFrom(line, {0.003, 0.004, 7}), 0.005, 1e-12) << "the line has no ends";
  EXPECT_NEAR(distanceFrom(line, {0, 0, -0.5}), 0, 1e-15);
  EXPECT_EQ(angleTo(line, {0, 0, -1}), 0);
  EXPECT_NEAR(angleTo(line, {0, 0, 1}), std::numbers::pi, 1e-15) << "the other way round is not agreement";
  EXPECT_NEAR(angleTo(line, {0, 1, 0}), std::numbers::pi / 2, 1e-15);
  // an arc cosine would lose such a small angle to rounding
  EXPECT_NEAR(angleTo(line, normalized(Vec3{1e-9, 0, -1})), 1e-9, 1e-20);
}

}  // namespace
}  // namespace needlelab
