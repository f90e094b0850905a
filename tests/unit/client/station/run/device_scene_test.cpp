#include "client/station/run/device_scene.h"

#include <gmock/gmock.h>

#include "common/scoring/measures.h"
#include "tests/support/scenes.h"

namespace needlelab {
namespace {

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
}  // namespace needlelab
