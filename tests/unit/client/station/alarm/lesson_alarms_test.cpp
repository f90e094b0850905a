#include "client/station/alarm/lesson_alarms.h"

#include <gmock/gmock.h>

#include <array>

namespace needlelab {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class KeptTone final : public Tone {
 public:
  void sound(bool danger) override { sounds.push_back(danger ? "high" : "low"); }
  std::vector<std::string> sounds;
};

/// A plane of skin with a vessel of 1 mm, 5 mm deep.
GestureAlarms vesselUnderSkin() {
  pb::Profile profile;
  profile.mutable_limb()->mutable_plane()->mutable_normal()->set_z(1);
  auto& hazard = *profile.add_hazards();
  hazard.set_name("artery");
  hazard.set_kind(pb::Hazard::VESSEL);
  hazard.mutable_center_m()->set_z(-0.005);
  hazard.set_radius_m(0.001);
  return {profile, anatomyOf(profile, {}), {8, 1}};
}

AlarmTick tickAt(double time_s, double depth_m, double force_N = 0) {
  return {time_s, force_N, depth_m > 0, {0, 0, -depth_m}, {0, 0, -depth_m}, depth_m > 0 ? 0 : -1, false};
}

TEST(LessonAlarms, areThoseOfTheGestureTheLoopTheDeviceAndTheTime) {
  KeptTone tone;
  LessonAlarms alarms(tone, ToneChoice::kOff);
  GestureAlarms gesture = vesselUnderSkin();
  gesture.add(tickAt(0, 0.005, 9));
  alarms.take(gesture);
  AlarmFacts facts;
  facts.left_s = 4.6;
  facts.hold = "the dead-man sensor is released";
  EXPECT_THAT(
      alarms.update(facts),
      ElementsAre(ActiveAlarm{Alarm::kHazard, "artery"}, ActiveAlarm{Alarm::kForce, "9.0 N, allowed 8 N"},
                  ActiveAlarm{Alarm::kDevice, "the dead-man sensor is released"},
                  ActiveAlarm{Alarm::kTime, "5 s left"}));
  facts.fault = Fault::kEmergencyStop;
  facts.gesture_shown = false;
  EXPECT_THAT(alarms.update(facts), ElementsAre(ActiveAlarm{Alarm::kFault, faultText(Fault::kEmergencyStop)},
                                                ActiveAlarm{Alarm::kTime, "5 s left"}))
      << "by feel";
  EXPECT_THAT(alarms.update({Fault::kNone, "", 10.1, true}), testing::SizeIs(2)) << "10.1 s are left";
  EXPECT_THAT(tone.sounds, IsEmpty());
}

TEST(LessonAlarms, aToneSoundsOnceForWhatBegins) {
  KeptTone tone;
  LessonAlarms alarms(tone, ToneChoice::kDanger);
  GestureAlarms gesture = vesselUnderSkin();
  alarms.update({});
  gesture.add(tickAt(0, 0.005));
  alarms.take(gesture);
  alarms.update({});
  alarms.update({});
  EXPECT_THAT(tone.sounds, ElementsAre("high"));
  gesture.add(tickAt(1, 0.02, 9));  // too much force alone is not a danger
  alarms.take(gesture);
  alarms.update({});
  EXPECT_THAT(tone.sounds, ElementsAre("high"));
  // away, there and away between two polls
  gesture.add(tickAt(3, -0.01));
  gesture.add(tickAt(4, 0.005));
  gesture.add(tickAt(6, -0.01));
  alarms.take(gesture);
  alarms.update({});
  EXPECT_THAT(tone.sounds, ElementsAre("high", "high"));
  AlarmFacts fault;
  fault.fault = Fault::kDeviceSilent;
  alarms.update(fault);
  alarms.update(fault);
  EXPECT_THAT(tone.sounds, ElementsAre("high", "high", "high"));
}

TEST(LessonAlarms, allMayHaveATone) {
  KeptTone tone;
  LessonAlarms alarms(tone, ToneChoice::kAll);
  alarms.update({Fault::kNone, "", 9.0, true});
  EXPECT_THAT(tone.sounds, ElementsAre("low"));
}

TEST(LessonAlarms, byFeelIsSilentAndHiddenAlarmsDoNotSoundLater) {
  KeptTone tone;
  LessonAlarms alarms(tone, ToneChoice::kAll);
  GestureAlarms gesture = vesselUnderSkin();
  gesture.add(tickAt(0, 0.005));
  alarms.take(gesture);
  AlarmFacts by_feel;
  by_feel.gesture_shown = false;
  alarms.update(by_feel);
  alarms.update({});
  EXPECT_THAT(tone.sounds, IsEmpty());
}

TEST(AudibleTone, isSilentWithoutACardAndEndsAtOnce) {
  AudibleTone tone;
  tone.sound(true);
  tone.sound(false);
}

}  // namespace
}  // namespace needlelab
