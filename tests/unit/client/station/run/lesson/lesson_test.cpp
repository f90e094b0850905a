#include <gmock/gmock.h>

#include "client/station/run/lesson/lesson.h"
#include "common/haptics/geometry.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/scoring/anatomy/anatomy.h"
#include "common/scoring/measures/measures.h"
#include "tests/support/scenes/scenes.h"

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
  // a point outside the limb in its own frame is also outside in W
  auto unplaced = lessonOfFile(practising("shoulder-adult.json"));
  for (const Vec3 p_L : {Vec3{0, 0, 0.01}, Vec3{0, 0, -0.01}, Vec3{0.03, 0.01, -0.02}})
    EXPECT_NEAR(signedDepth(lesson->model.limb, options.X_WL * p_L), signedDepth(unplaced->model.limb, p_L),
                1e-12);
  EXPECT_THAT(liveEffects(lesson->model), testing::Contains("CUTTING"));
  const auto targets = targetsOf(lesson->profile, options.X_WL);
  ASSERT_FALSE(targets.empty());
  // tip and opening are both in the target, equally far from its boundary
  const double behind_m = openingBehindTip_m(needleOf(lesson->profile.needle()));
  EXPECT_GT(behind_m, 0.001);
  const Anatomy anatomy = anatomyOf(lesson->profile, options.X_WL);
  const Vec3 entry = options.X_WL * Vec3{};
  const Vec3 opening = targets[0].center_W_m + behind_m * normalized(entry - targets[0].center_W_m);
  const DepthSpan span = depthSpanOf(anatomy, anatomy.targets[0]);
  EXPECT_NEAR(depthAt(anatomy, opening) - span.top_m, span.bottom_m - depthAt(anatomy, targets[0].center_W_m),
              1e-9);
  EXPECT_LT(distanceTo(anatomy, anatomy.targets[0], opening), 0);
  EXPECT_LT(distanceTo(anatomy, anatomy.targets[0], targets[0].center_W_m), 0);
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
  }
  options = practising("knee-adult.json");
  options.model = "PRECOMPUTED";
  EXPECT_THAT(lessonOfFile(options).error().message,
              testing::AllOf(HasSubstr("precomputed: is missing"), HasSubstr("needlelab-sim precompute")));
}

constexpr LoopDelay kOneTick{1, 0, true};

DeviceInfo deviceWith(double max_stiffness, double damping = 1.7) {
  DeviceInfo info{"test device", {}, true, true, true};
  info.limits.max_stiffness_N_per_m = max_stiffness;
  info.limits.damping_Ns_per_m = damping;
  return info;
}

TEST(DeviceFit, theStiffnessThatActsAtOnceDecides) {
  const SceneModel model = *compile(allEffects(), 1000);
  // wall and friction; the steepest membrane, 449 N/m, does not act with them
  const double at_once = model.wall.stiffness_N_per_m + model.friction_stiffness_N_per_m;
  EXPECT_TRUE(checkStiffness(model, deviceWith(at_once)).ok());
  const Status refused = checkStiffness(model, deviceWith(at_once - 0.5));
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(refused.error().message,
              testing::AllOf(HasSubstr("test device"), HasSubstr("640 N/m"), HasSubstr("639.5 N/m")));
  DeviceInfo recording = deviceWith(1);
  recording.renders_force = false;
  EXPECT_TRUE(checkStiffness(model, recording).ok()) << "a hand that feels nothing feels no stiffness";
}

StationLesson lessonOf(double fixture_N_per_m, double orientation_Nm_per_rad) {
  StationLesson lesson;
  lesson.scene = allEffects();
  lesson.scene.virtual_fixture.max_stiffness_N_per_m = fixture_N_per_m;
  lesson.scene.orientation_limit = {orientation_Nm_per_rad, 0.2};
  lesson.model = *compile(lesson.scene, 1000);
  return lesson;
}

TEST(DeviceFit, clampingAndOrientationLimitAreLoweredToWhatTheDeviceHolds) {
  std::vector<std::string> notes;
  StationLesson lesson = lessonOf(400, 0.5);
  ASSERT_TRUE(lowerForDevice(lesson, deviceWith(300), kOneTick, {}, notes).ok());
  EXPECT_NEAR(lesson.shares.lever, 0.75, 1e-12);
  EXPECT_NEAR(lesson.scene.virtual_fixture.max_stiffness_N_per_m, 300, 1e-9);
  EXPECT_THAT(notes, testing::ElementsAre(testing::AllOf(HasSubstr("400 N/m"), HasSubstr("300 N/m"),
                                                         HasSubstr("75 %"), HasSubstr("test device"))));
  lesson = lessonOf(400, 5);  // the Desktop renders rotations with 4 N·m/rad
  ASSERT_TRUE(lowerForDevice(lesson, deviceWith(1000), kOneTick, {}, notes).ok());
  EXPECT_NEAR(lesson.scene.orientation_limit.stiffness_Nm_per_rad, 4, 1e-12);
}

TEST(DeviceFit, theToolsLeverIsHeldByTheDevice) {
  const Pose tool{{0, 0, 0.13}, {}};
  std::vector<std::string> notes;
  StationLesson lesson = lessonOf(400, 0);
  ASSERT_TRUE(lowerForDevice(lesson, deviceWith(1000), kOneTick, tool, notes).ok());
  EXPECT_NEAR(lesson.shares.lever, 4 / 6.76, 1e-12);
  EXPECT_THAT(notes, testing::ElementsAre(testing::AllOf(HasSubstr("130 mm"), HasSubstr("6.76 N·m/rad"),
                                                         HasSubstr("4 N·m/rad"), HasSubstr("59 %"))));
  // fitLesson compiles what was lowered
  lesson = lessonOf(400, 0);
  StationOptions options;
  options.X_HT = tool;
  ASSERT_TRUE(fitLesson(lesson, deviceWith(1000), kOneTick, options, notes).ok());
  EXPECT_NEAR(lesson.model.fixture.max_stiffness_N_per_m, 400 * 4 / 6.76, 1e-9);
}

TEST(DeviceFit, aLessonOfLessThanHalfItsStiffnessIsRefused) {
  std::vector<std::string> notes;
  StationLesson lesson = lessonOf(400, 0);
  const Status refused = lowerForDevice(lesson, deviceWith(1000), kOneTick, {{0, 0, 0.15}, {}}, notes);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(refused.error().message, testing::AllOf(HasSubstr("150 mm"), HasSubstr("9 N·m/rad"),
                                                      HasSubstr("44 %"), HasSubstr("shorter tool")));
  EXPECT_EQ(lesson.scene.virtual_fixture.max_stiffness_N_per_m, 400);
}

TEST(DeviceFit, passivityControlCountsDeviceDampingAndIsReported) {
  const PassivitySettings settings = passivityOf(deviceWith(1000, 1.7), {3.2, 0.004, true});
  EXPECT_EQ(settings.delay_ticks, 4u) << "a part of a tick counts as one";
  EXPECT_EQ(settings.lag_s, 0.004);
  EXPECT_EQ(settings.damping_Ns_per_m, 1.7);
  std::vector<std::string> notes;
  StationLesson lesson = lessonOf(400, 0.5);
  StationOptions options;
  ASSERT_TRUE(fitLesson(lesson, deviceWith(1000), kOneTick, options, notes).ok());
  EXPECT_TRUE(notes.empty()) << "640 N/m; 1.7/(1 ms · 1.5) = 1133 N/m are passive";
  EXPECT_FALSE(lesson.passivity);
  options.passivity_control = true;
  ASSERT_TRUE(fitLesson(lesson, deviceWith(1000), kOneTick, options, notes).ok());
  EXPECT_THAT(notes, testing::ElementsAre(HasSubstr("Passivity control is on")));
  EXPECT_TRUE(lesson.passivity);
}

TEST(DeviceFit, passivityControlIsOnWhereALateForceIsNotProvenPassive) {
  const auto fitted = [](const DeviceInfo& device, const LoopDelay& delay) {
    StationLesson lesson = lessonOf(400, 0.5);
    std::vector<std::string> notes;
    EXPECT_TRUE(fitLesson(lesson, device, delay, {}, notes).ok());
    EXPECT_EQ(lesson.passivity.has_value(), !notes.empty());
    return notes.empty() ? std::string() : notes.front();
  };
  const double at_once = lessonOf(400, 0.5).model.axialStiffness_N_per_m();
  // b/(T (½ + d)) compared with the stiffness along the needle, just above and just below
  const double just = 1.7 / (1e-3 * at_once) - 0.5;
  EXPECT_EQ(fitted(deviceWith(2000, 1.7), {just - 1e-6, 0, true}), "");
  EXPECT_THAT(fitted(deviceWith(2000, 1.7), {just + 1e-6, 0, true}), HasSubstr("N/m steep"));
  // a lag counts as a delay of the same duration
  EXPECT_EQ(fitted(deviceWith(2000, 1.7), {0, (just - 1e-6) * 1e-3, true}), "");
  EXPECT_NE(fitted(deviceWith(2000, 1.7), {0, (just + 1e-6) * 1e-3, true}), "");
}

TEST(DeviceFit, anAssumedDelayIsSaidAndCountsLikeAMeasuredOne) {
  StationOptions options;
  StationLesson lesson = lessonOf(400, 0.5);
  std::vector<std::string> notes;
  // 640 N/m; 1.7/(1 ms · 3.5) = 486 N/m are passive
  ASSERT_TRUE(fitLesson(lesson, deviceWith(1000), LoopDelay{3}, options, notes).ok());
  EXPECT_THAT(notes, ElementsAre(testing::AllOf(HasSubstr("assumed to be 3 ticks, not measured"),
                                                HasSubstr("--measure-delay finds it")),
                                 HasSubstr("3 ticks late")));
  ASSERT_TRUE(lesson.passivity);
  EXPECT_EQ(lesson.passivity->delay_ticks, 3u);
  notes.clear();
  ASSERT_TRUE(fitLesson(lesson, deviceWith(1000), LoopDelay{0}, options, notes).ok());
  EXPECT_THAT(notes, ElementsAre(HasSubstr("assumed to be 0 ticks"))) << "also where nothing has to act";
  DeviceInfo recording = deviceWith(2000, 0);
  recording.renders_force = false;
  notes.clear();
  ASSERT_TRUE(fitLesson(lesson, recording, LoopDelay{}, options, notes).ok());
  EXPECT_THAT(notes, IsEmpty());
}

TEST(DeviceFit, whoFeelsNoLeverLosesNothingToIt) {
  std::vector<std::string> notes;
  const Pose tool{{0, 0, 0.15}, {}};
  for (const bool renders_force : {false, true}) {
    DeviceInfo info = deviceWith(1000);
    info.renders_force = renders_force;
    info.renders_torque = false;
    StationLesson lesson = lessonOf(400, 0);
    ASSERT_TRUE(lowerForDevice(lesson, info, kOneTick, tool, notes).ok());
    EXPECT_EQ(lesson.shares.lever, 1) << renders_force;
  }
  EXPECT_TRUE(notes.empty());
}

TEST(DeviceFit, boneAddsToTheFixtureSidewaysButNotToTissueAlong) {
  std::vector<std::string> notes;
  StationLesson lesson = lessonOf(400, 0);
  lesson.scene.layers.back().is_bone = true;
  lesson.scene.effects |= bitOf(Effect::kBone);
  double& bone = lesson.scene.stage_numbers[stageOf(Effect::kBone)][kBoneStiffness_N_per_m];
  bone = 600;
  lesson.model = *compile(lesson.scene, 1000);
  // the tissue's 640 N/m, not 1240
  EXPECT_NEAR(lesson.model.axialStiffness_N_per_m(), 640, 1e-9);
  EXPECT_TRUE(checkStiffness(lesson.model, deviceWith(640)).ok());
  ASSERT_TRUE(lowerForDevice(lesson, deviceWith(1000), kOneTick, {}, notes).ok());
  EXPECT_EQ(lesson.shares.lever, 1) << "600 and 400 N/m aside";
  ASSERT_TRUE(lowerForDevice(lesson, deviceWith(800), kOneTick, {}, notes).ok());
  EXPECT_NEAR(bone, 480, 1e-9);
  EXPECT_NEAR(lesson.scene.virtual_fixture.max_stiffness_N_per_m, 320, 1e-9);
}

TEST(DeviceFit, boneBelowHalfStiffnessIsOmittedAndReported) {
  const auto onBone = [](double fixture_N_per_m) {
    StationLesson lesson = lessonOf(fixture_N_per_m, 0.5);
    lesson.scene.layers.back().is_bone = true;
    lesson.scene.effects |= bitOf(Effect::kBone);
    lesson.scene.stage_numbers[stageOf(Effect::kBone)][kBoneStiffness_N_per_m] = 600;
    lesson.model = *compile(lesson.scene, 1000);
    return lesson;
  };
  StationOptions options;
  // 900 N/m · 0.08² + 0.5 = 6.26 N·m/rad
  options.X_HT = {{0, 0, 0.08}, {}};
  std::vector<std::string> notes;
  StationLesson lesson = onBone(300);
  ASSERT_TRUE(fitLesson(lesson, deviceWith(1200), kOneTick, options, notes).ok());
  EXPECT_NEAR(lesson.shares.lever, 4 / 6.26, 1e-12);
  EXPECT_TRUE(lesson.model.isLive(Effect::kBone));
  // 18.8, and without bone 300 N/m · 0.1427² + 0.5 = 6.6
  options.X_HT = {{0, 0, 0.1427}, {}};
  notes.clear();
  lesson = onBone(300);
  ASSERT_TRUE(fitLesson(lesson, deviceWith(1200), kOneTick, options, notes).ok());
  EXPECT_NEAR(lesson.shares.lever, 4 / (300 * 0.1427 * 0.1427 + 0.5), 1e-12);
  EXPECT_FALSE(lesson.model.isLive(Effect::kBone));
  EXPECT_EQ(lesson.left_out, bitOf(Effect::kBone));
  EXPECT_THAT(liveEffects(lesson.model), testing::Not(testing::Contains("BONE")));
  EXPECT_THAT(notes, testing::ElementsAre(testing::AllOf(HasSubstr("900 N/m"), HasSubstr("143 mm"),
                                                         HasSubstr("BONE is not live")),
                                          HasSubstr("rendered at 61 %")));
  // if still too stiff without bone, it is refused
  lesson = onBone(800);
  EXPECT_FALSE(fitLesson(lesson, deviceWith(2000), kOneTick, options, notes).ok());
}

// (b + 0.9)/(T(½ + D)), the lightest grip's damping with the device's: 2.6 N·s/m, 2 + 2 ticks late
TEST(DeviceFit, aLateForceLowersAllThatActsAtOnce) {
  const SceneSpec before = lessonOf(400, 0.5).scene;
  StationLesson lesson = lessonOf(400, 0.5);
  std::vector<std::string> notes;
  ASSERT_TRUE(fitLesson(lesson, deviceWith(1000), {2, 0.002, true}, {}, notes).ok());
  const double most = 2.6 / (1e-3 * 4.5), share = most / 640;
  EXPECT_NEAR(lesson.shares.delay, share, 1e-12);
  EXPECT_NEAR(lesson.model.axialStiffness_N_per_m(), most, 1e-9);
  EXPECT_NEAR(lesson.model.fixture.max_stiffness_N_per_m, 400 * share, 1e-9);
  EXPECT_EQ(lesson.model.orientation.stiffness_Nm_per_rad, 0.5);
  for (std::size_t i = 0; i < before.layers.size(); ++i) {
    const LayerSpec &was = before.layers[i], &now = lesson.scene.layers[i];
    EXPECT_EQ(now.cutting_force_N, was.cutting_force_N);
    if (!was.membrane) continue;
    EXPECT_EQ(now.membrane->force_N, was.membrane->force_N);
    // the same force after 1/share of the way
    const double z_m = 1e-3, farther_m = z_m / share;
    EXPECT_NEAR(
        now.membrane->linear_N_per_m * farther_m + now.membrane->quadratic_N_per_m2 * farther_m * farther_m,
        was.membrane->linear_N_per_m * z_m + was.membrane->quadratic_N_per_m2 * z_m * z_m, 1e-9);
  }
  EXPECT_THAT(notes, testing::Contains(testing::AllOf(HasSubstr("640 N/m"), HasSubstr("4 ticks late"),
                                                      HasSubstr("577.8 N/m"), HasSubstr("90 %"))));
  // in time, nothing is lowered
  lesson = lessonOf(400, 0.5);
  ASSERT_TRUE(fitLesson(lesson, deviceWith(1000), {2, 0, true}, {}, notes).ok());
  EXPECT_EQ(lesson.shares.delay, 1);
}

TEST(DeviceFit, ofLeverAndDelayTheLesserCounts) {
  for (const double late_ticks : {4.0, 6.0}) {
    StationLesson lesson = lessonOf(400, 0);
    StationOptions options;
    options.X_HT = {{0, 0, 0.11}, {}};
    std::vector<std::string> notes;
    ASSERT_TRUE(fitLesson(lesson, deviceWith(1000), {late_ticks, 0, true}, options, notes).ok());
    const double delay = std::min(1.0, 2.6 / (1e-3 * (0.5 + late_ticks)) / 640), lever = 4 / (400 * 0.0121);
    EXPECT_NEAR(lesson.shares.lever, lever, 1e-12);
    EXPECT_NEAR(lesson.model.fixture.max_stiffness_N_per_m, 400 * std::min(lever, delay), 1e-9);
    EXPECT_NEAR(lesson.model.wall.stiffness_N_per_m, 500 * delay, 1e-9) << "the lever does not lower it";
  }
}

TEST(DeviceFit, aLoopThatIsTooLateIsRefusedWithItsDelay) {
  StationLesson lesson = lessonOf(400, 0.5);
  std::vector<std::string> notes;
  const Status refused = fitLesson(lesson, deviceWith(1000), {8, 0, true}, {}, notes);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(refused.error().message, testing::AllOf(HasSubstr("8 ticks late"), HasSubstr("48 % of it"),
                                                      HasSubstr("make the delay shorter")));
  // a model without a wall has nothing to lower
  lesson.scene = paperOneDof();
  lesson.scene.axial_model = AxialModel::kVoigt;  // 500 N/m; 2.6/(1 ms · 5.5) are 473
  lesson.model = *compile(lesson.scene, 1000);
  EXPECT_TRUE(fitLesson(lesson, deviceWith(1000), {4, 0, true}, {}, notes).ok());
  EXPECT_THAT(fitLesson(lesson, deviceWith(1000), {5, 0, true}, {}, notes).error().message,
              HasSubstr("VOIGT has no wall"));
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

TEST(ForDevice, withoutTorqueOrOrientationTheLimitIsOffAndReported) {
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

TEST(ForDevice, theToolsTreatmentIsReported) {
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
  ASSERT_TRUE(fitLesson(lesson, device(true, false, false), kOneTick, options, notes).ok());
  EXPECT_FALSE(lesson.model.isLive(Effect::kOrientationLimit));
  EXPECT_TRUE(lesson.model.isLive(Effect::kClamping));
  EXPECT_EQ(lesson.model.rate_hz, options.rate_hz);
}

}  // namespace
}  // namespace needlelab::test
