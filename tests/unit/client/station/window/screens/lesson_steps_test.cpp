#include "client/station/window/screens/lesson_steps.h"

#include <gmock/gmock.h>

namespace needlelab::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Keys = std::vector<std::string>;

StepFacts capped(double right_m, double away_m, double above_skin_m, bool feels_bone = false) {
  StepFacts facts;
  facts.capped = true;
  facts.landmark_right_m = right_m;
  facts.landmark_away_m = away_m;
  facts.above_skin_m = above_skin_m;
  facts.feels_bone = feels_bone;
  return facts;
}

StepFacts needle(bool inside, double short_m, double plunger = 0.1) {
  StepFacts facts;
  facts.inside = inside;
  facts.above_skin_m = inside ? -0.01 : 0.01;
  facts.short_m = short_m;
  facts.plunger = plunger;
  return facts;
}

TEST(LessonSteps, leadThroughALessonOneKeyAtATime) {
  LessonSteps steps(true, true, "acromion", "bursa");
  const auto keys = [&](const StepFacts& facts) { return steps.next(facts).keys; };
  // over the landmark, slowly near it, then down until bone, up, cap off
  EXPECT_THAT(keys(capped(0.02, -0.01, 0.03)), ElementsAre("→"));
  EXPECT_THAT(keys(capped(0.002, -0.01, 0.03)), ElementsAre("↓"));
  EXPECT_THAT(keys(capped(0.002, -0.005, 0.03)), ElementsAre("Shift", "↓"));
  EXPECT_THAT(keys(capped(0.002, -0.002, 0.03)), ElementsAre("W"));
  EXPECT_THAT(keys(capped(0.002, -0.004, -0.004)), ElementsAre("W")) << "the skin gives way to a side";
  EXPECT_THAT(keys(capped(0.002, -0.002, -0.005, true)), ElementsAre("S"));
  EXPECT_EQ(steps.next(capped(0.002, -0.002, 0.001)).sentence, "Hold S until the needle is off the skin.");
  EXPECT_THAT(keys(capped(0.002, -0.002, 0.01)), ElementsAre("C"));
  // on the line, in, slowly
  StepFacts beside = needle(false, 0.05);
  beside.off_line_m = 0.015;
  EXPECT_THAT(keys(beside), ElementsAre("L"));
  EXPECT_EQ(steps.next(needle(false, 0.05)).sentence, "Hold W until the tip is near the bursa.");
  EXPECT_THAT(keys(needle(true, 0.02)), ElementsAre("W"));
  EXPECT_EQ(steps.next(needle(true, 0.005)).sentence, "Hold Shift and W until the tip is in the bursa.");
  // there: draw back, inject, come out, end
  StepFacts there = needle(true, 0.001);
  there.in_target = true;
  EXPECT_THAT(keys(there), ElementsAre("X"));
  there.plunger = 0.01;
  EXPECT_THAT(keys(there), ElementsAre("Space"));
  there.plunger = 0.5;
  EXPECT_THAT(keys(there), ElementsAre("Space")) << "it was drawn back";
  StepFacts slipped = needle(true, -0.002, 0.6);
  EXPECT_THAT(keys(slipped), ElementsAre("Shift", "S"));
  EXPECT_THAT(keys(there), ElementsAre("Space"));
  EXPECT_THAT(keys(needle(true, 0.003, 0.99)), ElementsAre("S"))
      << "a quick hand has left with the last drop";
  EXPECT_EQ(steps.next(needle(false, 0.05, 1)).number, 3);
  EXPECT_THAT(keys(needle(false, 0.05, 1)), ElementsAre("Esc", "Delete"));
}

TEST(LessonSteps, leadBackFromBoneFromBesideTheLineAndFromTooDeep) {
  LessonSteps steps(true, true, "", "bursa");
  StepFacts facts = needle(true, 0.02);
  facts.on_bone = true;
  EXPECT_EQ(steps.next(facts).sentence, "Hold S until the needle is out of the skin.");
  facts = needle(true, 0.02);
  facts.off_line_m = 0.007;
  EXPECT_THAT(steps.next(facts).keys, ElementsAre("S"));
  EXPECT_EQ(steps.next(needle(true, -0.003)).sentence,
            "Hold Shift and S until the tip is back in the bursa.");
}

TEST(LessonSteps, aLessonWithoutCapOrInjectionHasFewerSentences) {
  LessonSteps steps(true, false, "", "");
  EXPECT_EQ(steps.next(needle(false, 0.02)).sentence, "Hold W until the tip is near the target.");
  StepFacts there = needle(true, 0);
  there.in_target = true;
  EXPECT_EQ(steps.next(there).title, "Come out");
  EXPECT_THAT(steps.next(needle(false, 0.02)).keys, ElementsAre("Esc", "Delete"));
  StepFacts bare;
  bare.capped = true;
  bare.above_skin_m = 0.01;
  EXPECT_THAT(steps.next(bare).keys, ElementsAre("C")) << "no landmark to feel for";
}

TEST(LessonSteps, speakOfTheHandleWithoutMouseAndKeys) {
  LessonSteps steps(false, true, "patella", "recess");
  const LessonStep step = steps.next(capped(0.02, 0, 0.03));
  EXPECT_EQ(step.sentence, "Move the needle over the patella.");
  EXPECT_THAT(step.keys, IsEmpty());
}

}  // namespace
}  // namespace needlelab::test
