#include <gmock/gmock.h>

#include "client/station/run/lesson.h"
#include "common/haptics/tool_transform.h"
#include "common/profile/profile.h"
#include "common/scoring/measures.h"
#include "tests/support/scenes.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

const std::filesystem::path kSamples = NEEDLELAB_SAMPLES;

StationOptions practising(const char* profile) {
  StationOptions options;
  options.profile_file = kSamples / profile;
  return options;
}

TEST(StationLesson, aProfileFromAFileIsPlacedAndCompiled) {
  StationOptions options = practising("shoulder-adult.json");
  options.X_WL = {{0.1, 0.2, 0.3}, {1, 0, 0, 0}};
  auto lesson = lessonOfFile(options);
  ASSERT_TRUE(lesson.ok()) << lesson.error().message;
  EXPECT_EQ(lesson->profile_revision, 0u);
  EXPECT_EQ(lesson->profile.id(), "shoulder-adult");
  // a point outside the limb in its own frame is outside in W too
  auto unplaced = lessonOfFile(practising("shoulder-adult.json"));
  for (const Vec3 p_L : {Vec3{0, 0, 0.01}, Vec3{0, 0, -0.01}, Vec3{0.03, 0.01, -0.02}})
    EXPECT_NEAR(signedDepth(lesson->model.limb, options.X_WL * p_L), signedDepth(unplaced->model.limb, p_L),
                1e-12);
  EXPECT_THAT(liveEffects(lesson->model), testing::Contains("CUTTING"));
  const auto targets = targetsOf(lesson->profile, options.X_WL);
  ASSERT_FALSE(targets.empty());
  const auto& c = lesson->profile.targets(0).center_m();
  EXPECT_EQ(targets[0].center_W_m, options.X_WL * Vec3(c.x(), c.y(), c.z()));
}

TEST(StationLesson, theServersAnswerIsCheckedLikeAFile) {
  StationOptions options;
  options.exercise = "e1";
  pb::Lesson message;
  message.set_profile_json(profileJson(*loadProfile(kSamples / "knee-adult.json")));
  message.set_exercise_json(R"({"id": "e1", "name": "E", "profile_id": "knee-adult", "time_limit_s": 30})");
  message.set_profile_revision(5);
  auto lesson = lessonOfMessage(options, message);
  ASSERT_TRUE(lesson.ok()) << lesson.error().message;
  EXPECT_EQ(lesson->profile_revision, 5u);
  EXPECT_EQ(lesson->exercise->time_limit_s(), 30);
  message.set_exercise_json("{\"id\": 3}");
  EXPECT_THAT(lessonOfMessage(options, message).error().message, HasSubstr("exercise e1"));
  message.set_exercise_json(R"({"id": "e1", "name": "E", "profile_id": "knee-adult"})");
  message.set_profile_json("");
  EXPECT_EQ(lessonOfMessage(options, message).error().code, ErrorCode::kInvalidInput);
}

TEST(StationLesson, anUnknownModelIsRefusedWithThoseThatExist) {
  StationOptions options = practising("knee-adult.json");
  for (const char* name : {"GOD", "AXIAL_MODEL_UNSPECIFIED", "enhanced_tracking_wall"}) {
    options.model = name;
    auto lesson = lessonOfFile(options);
    ASSERT_FALSE(lesson.ok()) << name;
    EXPECT_EQ(lesson.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(lesson.error().message, testing::AllOf(HasSubstr(name), HasSubstr("ENHANCED_TRACKING_WALL")));
  }
  options.model = "ENHANCED_TRACKING_WALL";
  EXPECT_TRUE(lessonOfFile(options).ok());
}

TEST(StationLesson, everyAxialModelBecomesALessonThatTheDesktopCanRender) {
  StationOptions options = practising("shoulder-models.json");
  for (const std::string_view name : kAxialModelNames) {
    options.model = name;
    auto lesson = lessonOfFile(options);
    ASSERT_TRUE(lesson.ok()) << lesson.error().message;
    EXPECT_EQ(axialModelName(lesson->model.axial_model), name);
    EXPECT_THAT(liveEffects(lesson->model), testing::Contains("CUTTING"));
    EXPECT_GT(lesson->model.axialStiffness_N_per_m(), 0) << name;
    DeviceInfo desktop{"desktop", {}, true, true, true};
    EXPECT_TRUE(checkStiffness(lesson->model, desktop).ok()) << name;
    // The recorded and sent profile can be read again.
    EXPECT_TRUE(parseProfile(profileJson(lesson->profile), "again").ok()) << name;
  }
  options = practising("knee-adult.json");
  options.model = "PRECOMPUTED";
  EXPECT_THAT(lessonOfFile(options).error().message,
              testing::AllOf(HasSubstr("precomputed: is missing"), HasSubstr("needlelab-sim precompute")));
}

DeviceInfo deviceWith(double max_stiffness, double damping = 1.7) {
  DeviceInfo info{"test device", {}, true, true, true};
  info.limits.max_stiffness_N_per_m = max_stiffness;
  info.limits.damping_Ns_per_m = damping;
  return info;
}

TEST(DeviceFit, stiffnessesAddAndTheSumDecides) {
  const SceneModel model = *compile(allEffects(), 1000);
  const double sum = model.axialStiffness_N_per_m();
  ASSERT_GT(sum, model.wall.stiffness_N_per_m + model.friction_stiffness_N_per_m);
  EXPECT_TRUE(checkStiffness(model, deviceWith(sum)).ok());
  const Status refused = checkStiffness(model, deviceWith(sum - 0.5));
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(refused.error().message, testing::AllOf(HasSubstr("test device"), HasSubstr("N/m")));
  DeviceInfo recording = deviceWith(1);
  recording.renders_force = false;
  EXPECT_TRUE(checkStiffness(model, recording).ok()) << "a hand that feels nothing feels no stiffness";
}

TEST(DeviceFit, clampingAndOrientationLimitHaveTheirOwnBounds) {
  SceneSpec scene = allEffects();
  scene.virtual_fixture.max_stiffness_N_per_m = 1500;
  EXPECT_FALSE(checkStiffness(*compile(scene, 1000), deviceWith(1200)).ok());
  scene = allEffects();
  scene.orientation_limit = {5, 0.2};
  EXPECT_THAT(checkStiffness(*compile(scene, 1000), deviceWith(5000)).error().message,
              HasSubstr("orientation_limit"));
}

TEST(DeviceFit, boneAndTheFixtureAddAsideAndBoneAndTissueDoNotAlong) {
  SceneSpec scene = allEffects();
  scene.layers.back().is_bone = true;
  scene.effects |= bitOf(Effect::kBone);
  scene.stage_numbers[stageOf(Effect::kBone)][kBoneStiffness_N_per_m] = 700;
  const double aside = 700 + scene.virtual_fixture.max_stiffness_N_per_m;
  EXPECT_TRUE(checkStiffness(*compile(scene, 1000), deviceWith(aside)).ok());
  EXPECT_THAT(checkStiffness(*compile(scene, 1000), deviceWith(aside - 1)).error().message,
              HasSubstr("bone.stiffness_n_per_m and virtual_fixture.max_stiffness_n_per_m together"));
  scene.effects &= ~bitOf(Effect::kClamping);
  EXPECT_TRUE(checkStiffness(*compile(scene, 1000), deviceWith(1000)).ok());
}

TEST(DeviceFit, thePassivityBoundIsWarnedOfWithItsNumbers) {
  // (b + b_hand)/(T(½ + 1)): 0.3 + 0.3 N·s/m at 1 kHz allow 400 N/m
  const SceneModel model = *compile(paperOneDof(), 1000);  // 500 N/m
  const auto warning = passivityWarning(model, deviceWith(1000, 0.3), 0.3);
  ASSERT_TRUE(warning);
  EXPECT_THAT(*warning, testing::AllOf(HasSubstr("500 N/m"), HasSubstr("400 N/m")));
  EXPECT_FALSE(passivityWarning(model, deviceWith(1000, 0.3), 0.46));
  // A slower loop allows less.
  EXPECT_TRUE(passivityWarning(*compile(paperOneDof(), 250), deviceWith(1000, 1.7), 0.3));
}

TEST(DeviceFit, aModelsOwnDampingIsTakenFromWhatDeviceAndHandDamp) {
  SceneSpec scene = paperOneDof();
  scene.axial_model = AxialModel::kVoigt;  // 500 N/m
  scene.voigt.damping_Ns_per_m = 0.5;
  // (1.7 + 0.3 − 0.5)/(1 ms · 1.5) = 1000 N/m allow it; with B = 1.5 the limit is 333 N/m
  EXPECT_FALSE(passivityWarning(*compile(scene, 1000), deviceWith(1000), 0.3));
  scene.voigt.damping_Ns_per_m = 1.5;
  const auto warning = passivityWarning(*compile(scene, 1000), deviceWith(1000), 0.3);
  ASSERT_TRUE(warning);
  EXPECT_THAT(*warning, testing::AllOf(HasSubstr("333.3 N/m"), HasSubstr("1.5 of the model")));
}

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

DeviceInfo device(bool force, bool torque, bool orientation) {
  DeviceInfo info;
  info.renders_force = force;
  info.renders_torque = torque;
  info.has_orientation = orientation;
  return info;
}

TEST(ForDevice, whatADeviceCanDoIsLeftAsItIs) {
  for (const DeviceInfo& info : {device(true, true, true), device(false, false, true)}) {
    std::vector<std::string> notes;
    EXPECT_EQ(forDevice(test::allEffects(), info, notes).effects, test::allEffects().effects);
    noteTool({{0.1, 0, 0}, {1, 0, 0, 0}}, info, notes);
    EXPECT_THAT(notes, IsEmpty());
  }
}

TEST(ForDevice, withoutTorqueOrOrientationTheLimitIsNotLiveAndBothAreSaid) {
  std::vector<std::string> notes;
  const SceneSpec scene = forDevice(test::allEffects(), device(true, false, false), notes);
  EXPECT_EQ(scene.effects, test::allEffects().effects & ~bitOf(Effect::kOrientationLimit));
  EXPECT_THAT(notes, ElementsAre(HasSubstr("inward normal at the point of entry"),
                                 HasSubstr("ORIENTATION_LIMIT is not live: the device renders no torque")));
  EXPECT_FALSE(compile(scene, 1000)->isLive(Effect::kOrientationLimit));
}

TEST(ForDevice, eachLackAlone) {
  std::vector<std::string> no_torque, no_orientation;
  EXPECT_EQ(forDevice(test::allEffects(), device(true, false, true), no_torque).effects &
                bitOf(Effect::kOrientationLimit),
            0u);
  EXPECT_THAT(no_torque, ElementsAre(HasSubstr("renders no torque")));
  EXPECT_EQ(forDevice(test::allEffects(), device(true, true, false), no_orientation).effects &
                bitOf(Effect::kOrientationLimit),
            0u);
  EXPECT_THAT(no_orientation, SizeIs(2));
}

TEST(ForDevice, aSceneWithoutTheLimitLosesNothing) {
  std::vector<std::string> notes;
  EXPECT_EQ(forDevice(test::paperOneDof(), device(true, false, false), notes).effects,
            test::paperOneDof().effects);
  EXPECT_THAT(notes, SizeIs(1)) << "only the axis is assumed";
}

TEST(ForDevice, whatBecomesOfTheToolIsSaid) {
  const Pose tool{{0, 0, 0.15}, {0, 0, 0, 1}};
  std::vector<std::string> notes;
  noteTool({}, device(true, false, false), notes);
  EXPECT_THAT(notes, IsEmpty()) << "there is none";
  noteTool(tool, device(true, false, false), notes);
  noteTool(tool, device(true, false, true), notes);
  EXPECT_THAT(notes, ElementsAre(HasSubstr("along the axes of the device's base"), HasSubstr("lever")));
}

TEST(FitLesson, sceneAndModelAgreeAfterwards) {
  StationLesson lesson;
  lesson.scene = test::allEffects();
  lesson.model = *compile(lesson.scene, 1000);
  StationOptions options;
  std::vector<std::string> notes;
  ASSERT_TRUE(fitLesson(lesson, device(true, false, false), options, notes).ok());
  EXPECT_FALSE(lesson.model.isLive(Effect::kOrientationLimit));
  EXPECT_TRUE(lesson.model.isLive(Effect::kClamping));
  EXPECT_EQ(lesson.model.rate_hz, options.rate_hz);
}

}  // namespace
}  // namespace needlelab::test
