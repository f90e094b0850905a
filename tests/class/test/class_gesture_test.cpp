// What a simulated trainee does at the six steps: skill sets the hand, the scoring that people get says the
// rest.
#include "tests/class/class_gesture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "common/base/files.h"
#include "common/profile/profile.h"
#include "common/scoring/measures.h"

namespace needlelab {
namespace {

const std::filesystem::path kSamples = NEEDLELAB_SAMPLES;

std::vector<ClassLesson> sixSteps() {
  std::vector<ClassLesson> lessons;
  const auto course = loadCurriculum(kSamples / "injection-steps-curriculum.json");
  EXPECT_TRUE(course.ok());
  if (!course.ok()) return lessons;
  for (const pb::Exercise& exercise : course->exercises()) {
    pb::Lesson message;
    message.set_exercise_json(exerciseJson(exercise));
    message.set_profile_json(*readWholeFile(kSamples / (exercise.profile_id() + ".json")));
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

TEST(ClassGesture, expertsPassEachStepMoreOftenThanBeginners) {
  const auto lessons = sixSteps();
  ASSERT_EQ(lessons.size(), 6u);
  constexpr std::uint64_t kTries = 5;
  for (const ClassLesson& lesson : lessons) {
    EXPECT_EQ(lesson.profile_revision, 3u);
    std::uint64_t experts = 0, beginners = 0;
    for (std::uint64_t seed = 1; seed <= kTries; ++seed) {
      experts += passes(lesson, 1, seed);
      beginners += passes(lesson, 0, seed);
    }
    EXPECT_GE(experts, 3u) << lesson.exercise.id() << ": the step can be passed by a sure hand";
    EXPECT_LT(beginners, experts) << lesson.exercise.id();
  }
}

TEST(ClassGesture, isTheSameForTheSameSeedAndCountsTicks) {
  const auto lessons = sixSteps();
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
  auto lessons = sixSteps();
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

}  // namespace
}  // namespace needlelab
