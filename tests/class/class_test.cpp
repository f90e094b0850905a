// The final tables of a class, and options rejected before the start.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "common/base/files/files.h"
#include "common/profile/profile.h"
#include "common/scoring/measures/measures.h"
#include "tests/class/class_run.h"
#include "tests/class/class_station.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using ::testing::HasSubstr;

const std::vector<ClassTrainee> kTwo = {{"anna", 0.1}, {"liam", 0.9}};
const std::vector<std::string> kExercises = {"step-1", "step-2"};

ClassSession session(std::size_t trainee, std::size_t exercise, std::optional<bool> passed) {
  ClassSession s;
  s.plan = {trainee, exercise, 0, kTwo[trainee].skill, 1'700'000'000'000'000'000, 1};
  s.session_id = "id";
  s.samples = 1234;
  s.closed = true;
  s.passed = passed;
  return s;
}

TEST(ClassRun, theTableHasARowASession) {
  ClassSession locked;
  locked.plan = {0, 1, 2, 0.125, 1'700'000'060'000'000'000, 1};
  locked.locked = true;
  locked.trouble = "first pass \"step-1\", then\ncome back";
  EXPECT_EQ(classTable({session(0, 0, false), session(1, 0, std::nullopt), locked}, kTwo, kExercises),
            "session,trainee,exercise,attempt,skill,started_unix_s,samples,closed,passed,trouble\n"
            "id,anna,step-1,1,0.1000,1700000000,1234,1,0,\n"
            "id,liam,step-1,1,0.9000,1700000000,1234,1,,\n"
            ",anna,step-2,3,0.1250,1700000060,0,0,,\"first pass \"\"step-1\"\", then come back\"\n");
}

TEST(ClassRun, theTextCountsByHalves) {
  ClassSession locked;
  locked.plan.exercise = 1;
  locked.locked = true;
  const std::string text =
      classText({session(0, 0, false), session(0, 0, true), session(1, 0, true), locked}, kTwo, kExercises);
  EXPECT_THAT(text, ::testing::ContainsRegex("step-1 +1/2 +1/1 +0\n"));
  EXPECT_THAT(text, ::testing::ContainsRegex("step-2 +0/0 +0/0 +1\n"));
}

TEST(ClassRun, refusesNumbersOutOfRangeByName) {
  ClassOptions options;
  EXPECT_TRUE(checkClass(options).ok());
  options.timetable.attempts = 51;
  EXPECT_THAT(checkClass(options).error().message, HasSubstr("--attempts: 51"));
  options.timetable = {};
  options.timetable.weeks = 0;
  EXPECT_THAT(checkClass(options).error().message, HasSubstr("--weeks"));
  options.timetable = {};
  options.timetable.practice = 0.6;
  EXPECT_THAT(checkClass(options).error().message, HasSubstr("--practice"));
  options.timetable = {};
  options.keys.resize(33);
  EXPECT_THAT(checkClass(options).error().message, HasSubstr("--key: 33"));
}

TEST(ClassRun, refusesAnAddressAndAKeyThatAreNone) {
  const test::TempFolder folder;
  sigset_t none;
  ::sigemptyset(&none);
  ClassOptions options;
  options.exercises = kExercises;
  options.server = "127.0.0.1:99999";
  options.keys = {(folder.path() / "missing.key").string()};
  options.spool = folder.path().string();
  EXPECT_THAT(runClass(options, kTwo, none).error().message, HasSubstr("--server"));
  options.server = "127.0.0.1:1";
  const auto refused = runClass(options, kTwo, none);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr("missing.key"));
}

const std::filesystem::path kSamples = NEEDLELAB_SAMPLES, kVolumes = kSamples / "volumes";

/// The course of `deploy/demo --class`.
std::vector<ClassLesson> bodies() {
  std::vector<ClassLesson> lessons;
  const auto course = loadCurriculum(kVolumes / "bodies-curriculum.json");
  EXPECT_TRUE(course.ok());
  if (!course.ok()) return lessons;
  for (const pb::Exercise& exercise : course->exercises()) {
    if (!exercise.id().ends_with("-median")) continue;  // which deploy/class.sh practises
    pb::Lesson message;
    message.set_exercise_json(exerciseJson(exercise));
    message.set_profile_json(*readWholeFile(kVolumes / (exercise.profile_id() + ".json")));
    message.set_profile_revision(3);
    auto lesson = classLessonOf(message);
    EXPECT_TRUE(lesson.ok()) << (lesson.ok() ? "" : lesson.error().message);
    if (lesson.ok()) lessons.push_back(std::move(*lesson));
  }
  return lessons;
}

bool passes(const ClassLesson& lesson, double skill, std::uint64_t seed) {
  const auto samples = practiseOnce(lesson, skill, seed);
  EXPECT_TRUE(samples.ok()) << lesson.exercise.id() << ": " << (samples.ok() ? "" : samples.error().message);
  if (!samples.ok()) return false;
  const auto score = scoreGesture(*samples, kClassRate_hz, lesson.profile, Pose{}, &lesson.exercise);
  return std::none_of(score.begin(), score.end(), [](const Measure& m) { return m.passed == false; });
}

TEST(ClassGesture, expertsPassEachBodyMoreOftenThanBeginners) {
  const auto lessons = bodies();
  ASSERT_EQ(lessons.size(), 4u);
  constexpr std::uint64_t kTries = 5;
  for (const ClassLesson& lesson : lessons) {
    EXPECT_EQ(lesson.profile_revision, 3u);
    std::uint64_t experts = 0, beginners = 0, first_years = 0;
    for (std::uint64_t seed = 1; seed <= kTries; ++seed) {
      experts += passes(lesson, 1, seed);
      beginners += passes(lesson, 0, seed);
      first_years += passes(lesson, 0.25, seed);  // the middle of year 1 in deploy/class.sh
    }
    EXPECT_GE(experts, 3u) << lesson.exercise.id() << ": it can be passed by a sure hand";
    EXPECT_LT(beginners, experts) << lesson.exercise.id();
    EXPECT_LT(first_years, experts) << lesson.exercise.id();
  }
}

TEST(ClassGesture, isTheSameForTheSameSeedAndCountsTicks) {
  const auto lessons = bodies();
  ASSERT_FALSE(lessons.empty());
  const auto one = practiseOnce(lessons[0], 0.5, 7), two = practiseOnce(lessons[0], 0.5, 7),
             other = practiseOnce(lessons[0], 0.5, 8);
  ASSERT_TRUE(one.ok() && two.ok() && other.ok());
  ASSERT_EQ(one->size(), two->size());
  for (std::size_t i = 0; i < one->size(); ++i) {
    ASSERT_EQ((*one)[i].tick, i);
    ASSERT_EQ((*one)[i].time_ns, kClassClock_ns + static_cast<std::int64_t>(i) * 1'000'000);
    for (int axis = 0; axis < 3; ++axis) ASSERT_EQ((*one)[i].p_WT_m[axis], (*two)[i].p_WT_m[axis]);
  }
  EXPECT_NE(one->size(), other->size());
}

TEST(ClassGesture, theExercisesTimeEndsIt) {
  auto lessons = bodies();
  ASSERT_FALSE(lessons.empty());
  lessons[0].exercise.set_time_limit_s(1.5);
  EXPECT_EQ(practiseOnce(lessons[0], 0.5, 7)->size(), 1500u);
}

TEST(ClassGesture, aLessonWithoutATargetIsRefused) {
  pb::Lesson message;
  message.set_exercise_json(R"({"id": "e", "name": "e", "profile_id": "p"})");
  auto profile = loadProfile(kSamples / "finger-adult.json");
  ASSERT_TRUE(profile.ok());
  profile->clear_targets();
  message.set_profile_json(profileJson(*profile));
  const auto lesson = classLessonOf(message);
  ASSERT_FALSE(lesson.ok());
  EXPECT_NE(lesson.error().message.find("no target"), std::string::npos);
}

constexpr std::int64_t kMinute = 60'000'000'000, kHour = 60 * kMinute, kDay = 24 * kHour;
// Friday, 20 November 2026, 20:16 UTC
constexpr std::int64_t kNow = 1'795'205'760'000'000'000;

const std::vector<ClassTrainee> kThree = {{"anna", 0}, {"ben", 0.5}, {"liam", 1}};

TEST(Timetable, everybodyDoesEverythingInOrderAndInThePast) {
  TimetableOptions options;
  const auto plan = planClass(kThree, options, kNow);
  ASSERT_EQ(plan.size(), 3u * 6 * 3);
  std::map<std::size_t, std::size_t> next;
  std::set<std::uint64_t> seeds;
  const PlannedAttempt* last = nullptr;
  for (const PlannedAttempt& attempt : plan) {
    const std::size_t k = next[attempt.trainee]++;
    EXPECT_EQ(attempt.exercise, k / 3);
    EXPECT_EQ(attempt.number, k % 3);
    EXPECT_LE(attempt.started_unix_ns, kNow - kHour);
    EXPECT_GE(attempt.started_unix_ns, kNow - 4 * 7 * kDay - 5 * kDay)
        << "a weekend before it, and a part of a day";
    if (last != nullptr && last->trainee == attempt.trainee) {
      EXPECT_GE(attempt.started_unix_ns, last->started_unix_ns + 5 * kMinute);
    }
    EXPECT_TRUE(seeds.insert(attempt.seed).second);
    last = &attempt;
  }
}

TEST(Timetable, noPracticeAtNightOrOnWeekends) {
  TimetableOptions options;
  options.weeks = 8;
  for (std::int64_t day = 0; day < 7; ++day) {
    for (const PlannedAttempt& attempt : planClass(kThree, options, kNow + day * kDay)) {
      const std::int64_t days = attempt.started_unix_ns / kDay, hour = attempt.started_unix_ns % kDay / kHour;
      // 1 January 1970 was a Thursday: Saturday is day 2, Sunday day 3 of a week that begins there
      EXPECT_TRUE(days % 7 != 2 && days % 7 != 3) << days;
      EXPECT_TRUE(hour >= 8 && hour < 18) << hour;
    }
  }
}

TEST(Timetable, practiceClosesAFixedShareOfTheSkillGap) {
  TimetableOptions options;
  options.practice = 0.1;
  const auto plan = planClass(kThree, options, kNow);
  double missing = 1;
  for (std::size_t k = 0; k < 18; ++k, missing *= 0.9) EXPECT_NEAR(plan[k].skill, 1 - missing, 1e-12);
  for (std::size_t k = 36; k < 54; ++k) EXPECT_EQ(plan[k].skill, 1) << "an expert stays one";
}

TEST(Timetable, isTheSameForTheSameSeed) {
  TimetableOptions options;
  const auto one = planClass(kThree, options, kNow), two = planClass(kThree, options, kNow);
  options.seed = 2;
  const auto other = planClass(kThree, options, kNow);
  std::size_t moved = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].started_unix_ns, two[i].started_unix_ns);
    EXPECT_EQ(one[i].seed, two[i].seed);
    moved += one[i].started_unix_ns != other[i].started_unix_ns;
  }
  EXPECT_GT(moved, one.size() / 2);
}

TEST(Timetable, moreAttemptsThanDaysHoldStayInThePastAndApart) {
  TimetableOptions options;
  options.attempts = 50, options.weeks = 0.2;
  const auto plan = planClass({{"anna", 0}}, options, kNow);
  for (std::size_t k = 1; k < plan.size(); ++k)
    EXPECT_GE(plan[k].started_unix_ns, plan[k - 1].started_unix_ns + 5 * kMinute);
  EXPECT_LE(plan.back().started_unix_ns, kNow - kHour);
}

TEST(Timetable, traineesAreNamesWithASkill) {
  const auto tom = parseTrainee("tom=0.25");
  ASSERT_TRUE(tom.ok());
  EXPECT_EQ(tom->name, "tom");
  EXPECT_EQ(tom->skill, 0.25);
  EXPECT_EQ(parseTrainee("a=b=1")->name, "a=b");
  for (const char* const text : {"tom", "tom=", "=0.5", "tom=1.1", "tom=-0.1", "tom=nan", "tom=0.5x"}) {
    const auto refused = parseTrainee(text);
    ASSERT_FALSE(refused.ok()) << text;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
    EXPECT_NE(refused.error().message.find(text), std::string::npos);
  }
}

}  // namespace

}  // namespace needlelab
