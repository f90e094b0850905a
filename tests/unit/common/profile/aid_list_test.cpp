#include "common/profile/aid_list.h"

#include <gtest/gtest.h>

#include <initializer_list>

namespace needlelab {
namespace {

AidList listOf(std::initializer_list<int> numbers) {
  AidList list;
  for (const int number : numbers) list.Add(number);
  return list;
}

TEST(AidList, knownAidsOnceEachAreValid) {
  EXPECT_TRUE(checkAids("aids", {}).ok());
  AidList all;
  for (int aid = 1; aid <= 13; ++aid) all.Add(aid);
  EXPECT_TRUE(checkAids("aids", all).ok());
  for (const int none : {0, -1, 14, 1'000'000}) {
    const Status refused = checkAids("aids", listOf({1, none}));
    ASSERT_FALSE(refused.ok()) << none;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
    EXPECT_EQ(refused.error().message.rfind("aids[1]: ", 0), 0u) << refused.error().message;
  }
  const Status twice = checkAids("a.b", listOf({4, 2, 4}));
  ASSERT_FALSE(twice.ok());
  EXPECT_EQ(twice.error().message, "a.b[2]: FORCE is listed twice");
}

TEST(AidList, withoutASettingAllButTheSliceAndTheStepsAreOn) {
  pb::Exercise exercise;
  const AidList usual = aidsOfExercise(exercise);
  EXPECT_EQ(usual.size(), 11);
  EXPECT_FALSE(hasAid(usual, pb::Exercise::ULTRASOUND));
  EXPECT_FALSE(hasAid(usual, pb::Exercise::STEPS));
  EXPECT_TRUE(hasAid(usual, pb::Exercise::PHASE));
  EXPECT_TRUE(hasAid(usual, pb::Exercise::ALIGNMENT));
  EXPECT_TRUE(hasAid(usual, pb::Exercise::PLANNED_LINE));
  (void)exercise.mutable_aids();
  EXPECT_EQ(aidsOfExercise(exercise).size(), 0) << "an empty list is a choice";
  exercise.mutable_aids()->add_allowed(pb::Exercise::ULTRASOUND);
  EXPECT_TRUE(hasAid(aidsOfExercise(exercise), pb::Exercise::ULTRASOUND));
}

TEST(AidList, wordsComeBackAsTheyWent) {
  EXPECT_EQ(aidsText({}), "none");
  EXPECT_EQ(aidsText(listOf({3, 4})), "DEPTH, FORCE");
  EXPECT_EQ(aidsText(listOf({99})), "99") << "of a newer version";
  for (const char* text : {"depth,force", " Depth , FORCE ", "DEPTH,force"}) {
    const auto aids = parseAids(text);
    ASSERT_TRUE(aids.ok()) << text;
    EXPECT_EQ(aidsText(*aids), "DEPTH, FORCE");
  }
  EXPECT_EQ(parseAids("none")->size(), 0);
  EXPECT_EQ(parseAids("ALL")->size(), 13);
  for (const char* text : {"", ",", "depth,", "depth,depth", "aid_unspecified", "fish", "1", "all,depth"}) {
    const auto refused = parseAids(text);
    ASSERT_FALSE(refused.ok()) << text;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  }
}

}  // namespace
}  // namespace needlelab
