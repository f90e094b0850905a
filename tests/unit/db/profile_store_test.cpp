#include "db/profile_store.h"

#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

StoredProfile profile(const std::string& id, const std::string& json) {
  return {id, 0, "A knee", json, "bea", 9};
}

TEST(ProfileStore, anotherTextIsANewRevisionAndTheOldOneStays) {
  test::TestDb db;
  ProfileStore profiles(db.writer);
  EXPECT_EQ(*profiles.put(profile("knee", "{\"a\":1}")), 1u);
  EXPECT_EQ(*profiles.put(profile("knee", "{\"a\":2}")), 2u);
  EXPECT_EQ(profiles.get("knee", 1)->json, "{\"a\":1}");
  EXPECT_EQ(profiles.get("knee", 2)->json, "{\"a\":2}");
  EXPECT_EQ(profiles.get("knee", 0)->revision, 2u);
  // going back to an old text is a change, too
  EXPECT_EQ(*profiles.put(profile("knee", "{\"a\":1}")), 3u);
}

TEST(ProfileStore, theSameTextKeepsItsRevision) {
  test::TestDb db;
  ProfileStore profiles(db.writer);
  EXPECT_EQ(*profiles.put(profile("knee", "{\"a\":1}")), 1u);
  EXPECT_EQ(*profiles.put(profile("knee", "{\"a\":1}")), 1u);
  EXPECT_EQ(*profiles.put(profile("wrist", "{\"a\":1}")), 1u);
  const auto list = profiles.list();
  ASSERT_OK(list);
  ASSERT_EQ(list->size(), 2u);
  EXPECT_EQ((*list)[0].id, "knee");
  EXPECT_EQ((*list)[0].author, "bea");
}

TEST(ProfileStore, whatIsNotThereIsNamed) {
  test::TestDb db;
  ProfileStore profiles(db.writer);
  ASSERT_OK(profiles.put(profile("knee", "{}")));
  const auto missing = profiles.get("elbow", 0);
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
  EXPECT_NE(missing.error().message.find("'elbow'"), std::string::npos);
  EXPECT_NE(profiles.get("knee", 9).error().message.find("revision 9"), std::string::npos);
}

TEST(ProfileStore, hugeOrEmptyFieldsAreRefused) {
  test::TestDb db;
  ProfileStore profiles(db.writer);
  EXPECT_FALSE(profiles.put(profile("", "{}")).ok());
  EXPECT_FALSE(profiles.put(profile(std::string(65, 'x'), "{}")).ok());
  EXPECT_FALSE(profiles.put(profile("knee", "")).ok());
  EXPECT_FALSE(profiles.put(profile("knee", std::string(1'000'000, ' '))).ok());
}

}  // namespace
}  // namespace needlelab
