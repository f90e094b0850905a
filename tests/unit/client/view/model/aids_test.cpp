#include "client/view/model/aids.h"

#include <gtest/gtest.h>

#include <set>
#include <string_view>

namespace needlelab {
namespace {

TEST(AidSet, keepsWhatItWasToldAndGivesItBackInOrder) {
  AidSet aids;
  aids.set(pb::Exercise::ULTRASOUND, true);
  aids.set(pb::Exercise::PHASE, true);
  aids.set(pb::Exercise::FORCE, true);
  aids.set(pb::Exercise::FORCE, false);
  EXPECT_TRUE(aids.has(pb::Exercise::PHASE));
  EXPECT_FALSE(aids.has(pb::Exercise::FORCE));
  const AidList list = aids.list();
  ASSERT_EQ(list.size(), 2);
  EXPECT_EQ(list.Get(0), pb::Exercise::PHASE);
  EXPECT_EQ(list.Get(1), pb::Exercise::ULTRASOUND);
  EXPECT_EQ(AidSet(list), aids);
}

TEST(AidSet, passesOverNumbersThatAreNoAid) {
  AidList list;
  list.Add(999);
  list.Add(pb::Exercise::AID_UNSPECIFIED);
  list.Add(pb::Exercise::DEPTH);
  AidSet depth;
  depth.set(pb::Exercise::DEPTH, true);
  EXPECT_EQ(AidSet(list), depth);
}

TEST(AidSet, usualIsAllButTheUltrasoundPicture) {
  AidSet all = allAidSet();
  EXPECT_TRUE(all.has(pb::Exercise::ULTRASOUND));
  all.set(pb::Exercise::ULTRASOUND, false);
  EXPECT_EQ(all, usualAidSet());
}

TEST(AidSet, everyAidHasWordsOfItsOwn) {
  std::set<std::string_view> words;
  for (const int aid : allAidSet().list()) words.insert(aidWord(static_cast<pb::Exercise::Aid>(aid)));
  EXPECT_EQ(words.size(), static_cast<std::size_t>(allAidSet().list().size()));
  EXPECT_FALSE(words.contains("unknown aid"));
}

}  // namespace
}  // namespace needlelab
