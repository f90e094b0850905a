#include <gmock/gmock.h>

#include "client/station/window/screens/end_screen.h"
#include "common/scoring/measures/measures.h"
#include "tests/support/time_zone.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

LessonOutcome scored(const std::vector<Measure>& measures) {
  LessonOutcome outcome;
  outcome.summary.score_json = scoreJson(measures);
  outcome.summary.score_source = "station";
  outcome.summary.servo.end = ServoEnd::kTicksDone;
  return outcome;
}

Measure required(const std::string& name, bool passed) {
  Measure measure;
  measure.name = name;
  measure.unit = "N";
  measure.value = 1;
  measure.max = passed ? 2 : 0.5;
  measure.passed = passed;
  measure.words = name + (passed ? " is met" : " is missed");
  return measure;
}

Measure plain(const std::string& name) {
  Measure measure;
  measure.name = name;
  measure.words = name;
  return measure;
}

TEST(EndScreen, missedRequirementsComeFirst) {
  const LessonVerdict verdict =
      verdictOf(scored({required("a", true), plain("b"), required("c", false), required("d", true)}));
  EXPECT_EQ(verdict.kind, LessonVerdict::Kind::kNotPassed);
  EXPECT_EQ(verdict.title, "Not passed: 1 of 3 requirements is not met");
  ASSERT_EQ(verdict.required.size(), 3u);
  EXPECT_EQ(verdict.required[0].words, "c is missed");
  EXPECT_EQ(verdict.required[1].words, "a is met");
  ASSERT_EQ(verdict.others.size(), 1u);
  EXPECT_EQ(verdict.ended, "time is over");
  EXPECT_EQ(verdict.by, "scored by this station");
}

TEST(EndScreen, aSofterRenderingIsNotedNextToIt) {
  LessonOutcome outcome = scored({required("a", true)});
  EXPECT_TRUE(verdictOf(outcome).lowered.empty());
  outcome.summary.shares.lever = 0.551;
  EXPECT_THAT(verdictOf(outcome).lowered, HasSubstr("55 % of the profile's stiffness"));
  outcome.summary.left_out = bitOf(Effect::kBone);
  EXPECT_THAT(verdictOf(outcome).lowered, HasSubstr("Bone was left out"));
}

TEST(EndScreen, allMetIsPassed) {
  const LessonVerdict verdict = verdictOf(scored({required("a", true), required("b", true)}));
  EXPECT_EQ(verdict.kind, LessonVerdict::Kind::kPassed);
  EXPECT_THAT(verdict.title, HasSubstr("Passed"));
}

TEST(EndScreen, withoutRequirementsThereIsNoFail) {
  EXPECT_EQ(verdictOf(scored({plain("a")})).kind, LessonVerdict::Kind::kNoRequirements);
}

TEST(EndScreen, nothingRecordedIsNoScore) {
  LessonOutcome outcome;
  EXPECT_EQ(verdictOf(outcome).kind, LessonVerdict::Kind::kNoScore);
  outcome.summary.score_json = "{";
  EXPECT_EQ(verdictOf(outcome).kind, LessonVerdict::Kind::kNoScore);
}

TEST(EndScreen, ofAnExamShowsTheDateOfItsResult) {
  const test::WithZone zone("UTC");
  LessonOutcome outcome = scored({required("a", true), plain("b")});
  outcome.summary.results_from_unix_ns = 1'780'495'200'000'000'000;
  const LessonVerdict verdict = verdictOf(outcome);
  EXPECT_EQ(verdict.title, "Your result is shown from 3 June 2026, 14:00 on.");
  EXPECT_EQ(verdict.kind, LessonVerdict::Kind::kNoScore);
  EXPECT_TRUE(verdict.required.empty());
  EXPECT_TRUE(verdict.others.empty());
  EXPECT_EQ(verdict.by, "");
  EXPECT_EQ(verdict.ended, "time is over");
}

TEST(EndScreen, whoStoppedItAndWhy) {
  LessonOutcome outcome = scored({plain("a")});
  outcome.summary.stopped = StopCause{"ines", "wrong side"};
  EXPECT_EQ(verdictOf(outcome).ended, "stopped by ines: wrong side");
  outcome.summary.stopped = StopCause{};
  EXPECT_EQ(verdictOf(outcome).ended, "stopped at the window");
  outcome.summary.servo.fault = Fault::kTipTooFast;
  EXPECT_THAT(verdictOf(outcome).ended, HasSubstr("FAULT"));
}

TEST(EndScreen, whereTheRecordingIs) {
  LessonOutcome outcome = scored({plain("a")});
  EXPECT_THAT(verdictOf(outcome).kept, HasSubstr("this station's spool"));
  outcome.summary.has_server = true;
  EXPECT_THAT(verdictOf(outcome).kept, HasSubstr("on its way"));
  outcome.summary.state = "COMPLETE";
  outcome.summary.score_source = "server";
  EXPECT_THAT(verdictOf(outcome).kept, HasSubstr("server's database"));
  EXPECT_EQ(verdictOf(outcome).by, "scored by the server");
  EXPECT_TRUE(verdictOf(outcome).kept_well);
  outcome.stored = Error{ErrorCode::kUnavailable, "the disk is full"};
  EXPECT_EQ(verdictOf(outcome).kept, "Not all of the recording is stored: the disk is full.");
  EXPECT_FALSE(verdictOf(outcome).kept_well);
}

TEST(EndScreen, aCodeThatWasNotCheckedWaitsForAManager) {
  LessonOutcome outcome = scored({plain("a")});
  EXPECT_EQ(verdictOf(outcome).waits, "");
  outcome.code_unchecked = true;
  EXPECT_EQ(verdictOf(outcome).waits,
            "The server is away: your code was not checked. A manager confirms this session later.");
}

TEST(EndScreen, aServersRefusalIsShown) {
  LessonOutcome outcome = scored({plain("a")});
  outcome.summary.has_server = true;
  outcome.summary.uplink.current_trouble = "no such trainee";
  const LessonVerdict verdict = verdictOf(outcome);
  EXPECT_EQ(verdict.kept, "The server did not accept the recording: no such trainee.");
  EXPECT_FALSE(verdict.kept_well);
}

}  // namespace
}  // namespace needlelab
