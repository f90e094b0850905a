// The demonstration of each sample exercise does what the exercise asks for.
#include "client/station/run/lesson/demonstration.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "common/base/files/files.h"
#include "common/profile/profile.h"
#include "common/scoring/measures/measures.h"

namespace needlelab::test {
namespace {

const std::filesystem::path kFolder = std::filesystem::path(NEEDLELAB_SAMPLES);

struct Sample {
  std::filesystem::path curriculum, profiles;
};

StationLesson lessonOn(const pb::Exercise& exercise, const std::filesystem::path& profiles) {
  pb::Lesson message;
  const auto profile = loadProfile(profiles / (exercise.profile_id() + ".json"));
  EXPECT_TRUE(profile.ok());
  message.set_exercise_json(exerciseJson(exercise));
  message.set_profile_json(profileJson(*profile));
  StationOptions options;
  options.exercise = exercise.id();
  auto lesson = lessonOfMessage(options, message);
  EXPECT_TRUE(lesson.ok()) << lesson.error().message;
  return *std::move(lesson);
}

std::vector<GestureSample> samplesOf(const Demonstration& demonstration) {
  std::vector<GestureSample> samples;
  for (const auto& piece : demonstration.pieces)
    samples.insert(samples.end(), piece.samples.begin(), piece.samples.end());
  return samples;
}

TEST(Demonstration, ofEverySampleExerciseMeetsItsRequirements) {
  int exercises = 0;
  for (const auto& [file, profiles] :
       {Sample{"volumes/bodies-curriculum.json", "volumes"}, Sample{"curriculum.json", ""}}) {
    const auto text = readWholeFile(kFolder / file);
    ASSERT_TRUE(text.ok());
    const auto curriculum = parseCurriculum(*text, file.string());
    ASSERT_TRUE(curriculum.ok()) << curriculum.error().message;
    for (const pb::Exercise& exercise : curriculum->exercises()) {
      SCOPED_TRACE(exercise.id());
      ++exercises;
      const StationLesson lesson = lessonOn(exercise, kFolder / profiles);
      const auto made = demonstrationOf(lesson, {}, lesson.model.isLive(Effect::kPalpation));
      ASSERT_TRUE(made.ok()) << made.error().message;
      const auto samples = samplesOf(*made);
      for (const Measure& row : scoreGesture(samples, lesson.model.rate_hz, lesson.profile, {}, &exercise))
        if (row.passed) EXPECT_TRUE(*row.passed) << row.name << " " << row.value;
      EXPECT_LT(made->duration_s(), 40) << "nobody watches longer";
    }
  }
  EXPECT_GE(exercises, 19);
}

}  // namespace
}  // namespace needlelab::test
