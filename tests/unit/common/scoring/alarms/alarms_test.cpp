#include "common/scoring/alarms/alarms.h"

#include <gmock/gmock.h>

#include <set>

#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

/// Three layers of 10 mm, the last one bone; a nerve of 1 mm 15 mm deep, a target of 2 mm 12 mm deep.
pb::Profile nerveAboveBone() {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.012}, 0.002);
  addBallHazard(profile, "nerve", {0, 0, -0.015}, 0.001);
  profile.mutable_hazards(0)->set_kind(pb::Hazard::NERVE);
  return profile;
}

class Alarms : public testing::Test {
 protected:
  void make(const pb::Profile& profile, const pb::Exercise* exercise = nullptr) {
    const Anatomy anatomy = anatomyOf(profile, {});
    alarms_ = GestureAlarms(profile, anatomy, alarmLimitsOf(anatomy, exercise));
  }
  /// Straight down with the tip this deep.
  std::vector<ActiveAlarm> at(double time_s, double depth_m, double force_N = 1) {
    AlarmTick tick;
    tick.time_s = time_s;
    tick.force_N = force_N;
    tick.inside = depth_m > 0;
    tick.tip_W_m = {0, 0, -depth_m};
    tick.layer = depth_m > 0 ? static_cast<int>(depth_m / 0.01) : -1;
    const auto begun = alarms_.add(tick);
    return {begun.begin(), begun.end()};
  }
  GestureAlarms alarms_;
};

TEST(AlarmKinds, standInTheOrderOfTheirNumbersWithNamesOfTheirOwn) {
  std::set<std::string_view> names, words;
  for (const AlarmKind& kind : alarmKinds()) {
    EXPECT_EQ(kindOf(kind.alarm).name, kind.name);
    EXPECT_TRUE(names.insert(kind.name).second);
    EXPECT_TRUE(words.insert(kind.word).second);
  }
  EXPECT_EQ(alarmKinds().size(), 7u);
}

TEST_F(Alarms, aHazardStartsAtContactAndLastsASecondLonger) {
  make(nerveAboveBone());
  EXPECT_THAT(at(0, 0.0139), IsEmpty());
  EXPECT_THAT(alarms_.now(), IsEmpty());
  EXPECT_THAT(at(0.1, 0.0141), ElementsAre(ActiveAlarm{Alarm::kHazard, "nerve"}));
  EXPECT_THAT(at(0.2, 0.0141), IsEmpty()) << "it lasts";
  at(0.3, -0.01);
  at(1.19, -0.01);
  EXPECT_THAT(alarms_.now(), ElementsAre(ActiveAlarm{Alarm::kHazard, "nerve"}));
  at(1.21, -0.01);
  EXPECT_THAT(alarms_.now(), IsEmpty());
  EXPECT_THAT(at(1.3, 0.0141), ElementsAre(ActiveAlarm{Alarm::kHazard, "nerve"})) << "another one";
  ASSERT_EQ(alarms_.counts().size(), 1u);
  EXPECT_EQ(alarms_.counts()[0].begun, 2u);
  EXPECT_TRUE(alarms_.counts()[0].now);
}

TEST_F(Alarms, aBoneAlarmNeedsABoneLayerOrBoneHazard) {
  pb::Profile profile = nerveAboveBone();
  addBallHazard(profile, "humeral head", {0, 0, -0.009}, 0.001);
  profile.mutable_hazards(1)->set_kind(pb::Hazard::BONE);
  make(profile);
  EXPECT_THAT(at(0, 0.009), ElementsAre(ActiveAlarm{Alarm::kBone, "bone contact"})) << "no hazard besides";
  EXPECT_THAT(at(5, 0.0205),
              ElementsAre(ActiveAlarm{Alarm::kHazard, "nerve"}, ActiveAlarm{Alarm::kBone, "bone contact"},
                          ActiveAlarm{Alarm::kDepth, "20.5 mm, allowed 19 mm"}));
}

TEST_F(Alarms, tooDeepIsFiveMillimetresBelowTheTargetOrTheExercisesLimit) {
  make(nerveAboveBone());
  EXPECT_THAT(at(0, 0.0189), ElementsAre(ActiveAlarm{Alarm::kHazard, "nerve"})) << "by the shaft";
  EXPECT_THAT(at(0.1, 0.0191), ElementsAre(ActiveAlarm{Alarm::kDepth, "19.1 mm, allowed 19 mm"}));
  at(0.2, 0.0195);
  EXPECT_EQ(alarms_.now().back().detail, "19.5 mm, allowed 19 mm") << "the worst so far";
  pb::Exercise exercise;
  auto& limit = *exercise.add_requirements();
  limit.set_measure("greatest_depth_m");
  limit.set_max(0.008);
  make(nerveAboveBone(), &exercise);
  EXPECT_THAT(at(0, 0.0079), IsEmpty());
  EXPECT_THAT(at(0.1, 0.0085), ElementsAre(ActiveAlarm{Alarm::kDepth, "8.5 mm, allowed 8 mm"}));
}

TEST_F(Alarms, theForcesLimitIsTheExercisesOrEightNewtons) {
  make(nerveAboveBone());
  EXPECT_THAT(at(0, -0.01, 7.9), IsEmpty());
  EXPECT_THAT(at(0.1, -0.01, 8.1), ElementsAre(ActiveAlarm{Alarm::kForce, "8.1 N, allowed 8 N"}));
  pb::Exercise exercise;
  auto& limit = *exercise.add_requirements();
  limit.set_measure("peak_force_n");
  limit.set_max(4.5);
  make(nerveAboveBone(), &exercise);
  EXPECT_THAT(at(0, 0.005, 5), ElementsAre(ActiveAlarm{Alarm::kForce, "5.0 N, allowed 4.5 N"}));
}

TEST_F(Alarms, aHubOnTheSkinIsTooDeep) {
  make(nerveAboveBone());
  AlarmTick tick;
  tick.inside = tick.hub_on_skin = true;
  tick.layer = 0;
  EXPECT_THAT(alarms_.add(tick), ElementsAre(ActiveAlarm{Alarm::kDepth, "hub on the skin"}));
}

TEST_F(Alarms, anEarlierTimeBeginsAnotherGesture) {
  make(nerveAboveBone());
  at(5, 0.0141);
  EXPECT_THAT(at(1, -0.01), IsEmpty());
  EXPECT_THAT(alarms_.now(), IsEmpty());
  EXPECT_THAT(alarms_.counts(), IsEmpty());
}

}  // namespace
}  // namespace needlelab
