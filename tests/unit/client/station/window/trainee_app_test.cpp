#include <gtest/gtest.h>

#include "client/station/window/trainee_app.h"

namespace needlelab {
namespace {

using When = PictureRequest::When;

TEST(TraineeApp, takesEachPictureOnceWhenItsTimeHasCome) {
  PicturePlan plan({{"start", When::kStart, 0},
                    {"early", When::kLesson, 0},
                    {"late", When::kLesson, 2},
                    {"end", When::kEnd, 0}});
  const auto names = [&](Stage stage, double s) {
    std::string text;
    for (const auto& picture : plan.due(stage, s)) text += picture.file.string() + " ";
    return text;
  };
  // A screen's layout settles in its first frames.
  EXPECT_EQ(names(Stage::kStart, 0) + names(Stage::kStart, 0), "");
  EXPECT_EQ(names(Stage::kStart, 0), "start ");
  EXPECT_EQ(names(Stage::kStart, 0), "");
  EXPECT_EQ(names(Stage::kPreparing, 0), "");
  EXPECT_EQ(names(Stage::kLesson, 0) + names(Stage::kLesson, 0.1), "");
  EXPECT_EQ(names(Stage::kLesson, 0.2), "early ");
  EXPECT_EQ(names(Stage::kLesson, 1.9), "");
  EXPECT_EQ(names(Stage::kLesson, 2.4), "late ") << "the first frame after it";
  EXPECT_FALSE(plan.done());
  EXPECT_EQ(plan.missing().size(), 1u);
  EXPECT_EQ(names(Stage::kEnd, 2.5) + names(Stage::kEnd, 2.5) + names(Stage::kEnd, 2.5), "end ");
  EXPECT_TRUE(plan.done());
}

TEST(TraineeApp, aLessonThatEndedBeforeLeavesAPictureMissing) {
  PicturePlan plan({{"late", When::kLesson, 9}});
  EXPECT_TRUE(plan.due(Stage::kEnd, 10).empty());
  ASSERT_EQ(plan.missing().size(), 1u);
  EXPECT_EQ(plan.missing()[0].file, "late");
  EXPECT_TRUE(PicturePlan({}).done());
}

// a program without a display relies on this to end, however few frames a busy machine drew
TEST(TraineeApp, isDoneWithPicturesOfAnEndedLessonOnceItsEndIsShown) {
  PicturePlan plan({{"late", When::kLesson, 1}, {"end", When::kEnd, 0}});
  EXPECT_TRUE(plan.due(Stage::kLesson, 0.5).empty());
  EXPECT_FALSE(plan.done());
  for (int frame = 0; frame < 2; ++frame) {
    EXPECT_TRUE(plan.due(Stage::kEnd, 3).empty());
    EXPECT_FALSE(plan.done()) << "its end is to come";
  }
  EXPECT_EQ(plan.due(Stage::kEnd, 3).size(), 1u);
  EXPECT_TRUE(plan.done());
  ASSERT_EQ(plan.missing().size(), 1u);
  // a person begins another lesson
  EXPECT_TRUE(plan.due(Stage::kLesson, 0).empty());
  EXPECT_FALSE(plan.done());
}

}  // namespace
}  // namespace needlelab
