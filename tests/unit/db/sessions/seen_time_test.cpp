// The latest time that the server's clock has shown, and what is recorded while the clock is behind it.
#include "db/sessions/seen_time.h"

#include "db/store/schema.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

class SeenTimeTest : public testing::Test {
 protected:
  std::int64_t latest() { return test::TestDb::must(seen.latest()); }
  std::map<Uuid, std::int64_t> closedBehind() { return test::TestDb::must(seen.closedBehind()); }

  test::TestDb db;
  SeenTimeStore seen{db.writer};
};

TEST_F(SeenTimeTest, onlyALaterTimeIsNoted) {
  EXPECT_EQ(latest(), 0);
  ASSERT_OK(seen.note(20 * test::kDay_ns));
  ASSERT_OK(seen.note(10 * test::kDay_ns));
  EXPECT_EQ(latest(), 20 * test::kDay_ns);
  ASSERT_OK(seen.note(21 * test::kDay_ns));
  EXPECT_EQ(latest(), 21 * test::kDay_ns);
}

TEST_F(SeenTimeTest, anUpgradedDatabaseKnowsItsSessionsAndCreationTimes) {
  ASSERT_OK(MetaStore(db.writer).set("created_unix_ns", std::to_string(3 * test::kDay_ns)));
  EXPECT_EQ(latest(), 3 * test::kDay_ns);
  const Uuid id = makeUuidV7();
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  ASSERT_OK(SessionStore(db.writer).append(id, 0, test::chunkOf(0)));
  ASSERT_OK(SessionStore(db.writer).close(test::closeOf(id, 1), 7 * test::kDay_ns));
  EXPECT_EQ(latest(), 7 * test::kDay_ns);
  ASSERT_OK(seen.note(5 * test::kDay_ns));
  EXPECT_EQ(latest(), 7 * test::kDay_ns);
}

TEST_F(SeenTimeTest, aCloseIsNotedOnlyIfTheClockIsClearlyBehind) {
  const Uuid right = makeUuidV7(), little = makeUuidV7(), behind = makeUuidV7();
  ASSERT_OK(seen.noteClose(right, 20 * test::kDay_ns));
  ASSERT_OK(seen.noteClose(little, 20 * test::kDay_ns - kClockSlack_ns));
  EXPECT_TRUE(closedBehind().empty());
  ASSERT_OK(seen.noteClose(behind, 20 * test::kDay_ns - kClockSlack_ns - 1));
  EXPECT_EQ(closedBehind(), (std::map<Uuid, std::int64_t>{{behind, 20 * test::kDay_ns}}));
  EXPECT_EQ(latest(), 20 * test::kDay_ns);
}

TEST_F(SeenTimeTest, aClockAheadIsForgottenOnConfirmation) {
  ASSERT_OK(seen.note(400 * test::kDay_ns));
  EXPECT_NE(test::TestDb::must(seen.behindText(20 * test::kDay_ns)), "");
  ASSERT_OK(seen.confirm(20 * test::kDay_ns));
  EXPECT_EQ(latest(), 20 * test::kDay_ns);
  EXPECT_EQ(test::TestDb::must(seen.behindText(20 * test::kDay_ns)), "");
}

TEST_F(SeenTimeTest, aClockJumpingAheadIsReportedAndUntrustedUntilConfirmed) {
  const std::int64_t most = 20 * test::kDay_ns + kMaxAhead_ns;
  ASSERT_OK(seen.note(20 * test::kDay_ns));
  EXPECT_EQ(test::TestDb::must(seen.aheadText(most)), "");
  for (int start = 0; start < 2; ++start) {
    const std::string text = test::TestDb::must(seen.aheadText(400 * test::kDay_ns));
    EXPECT_NE(text.find("380 days after"), std::string::npos) << text;
    EXPECT_NE(text.find("needlelab-admin retention run"), std::string::npos) << text;
    ASSERT_OK(seen.note(400 * test::kDay_ns));
    ASSERT_OK(seen.noteClose(makeUuidV7(), 400 * test::kDay_ns));
    ASSERT_OK(seen.note(most + 1));
    EXPECT_EQ(latest(), 20 * test::kDay_ns);
  }
  // set right again: it was never ahead
  EXPECT_EQ(test::TestDb::must(seen.behindText(20 * test::kDay_ns)), "");
  ASSERT_OK(seen.note(most));
  EXPECT_EQ(latest(), most);
  ASSERT_OK(seen.confirm(400 * test::kDay_ns));
  EXPECT_EQ(test::TestDb::must(seen.aheadText(400 * test::kDay_ns)), "");
}

TEST_F(SeenTimeTest, afterAnUpgradeAFastClocksCloseIsNotTheLatestTime) {
  ASSERT_OK(MetaStore(db.writer).set("created_unix_ns", std::to_string(3 * test::kDay_ns)));
  ASSERT_OK(seen.note(400 * test::kDay_ns));
  const Uuid id = makeUuidV7();
  ASSERT_OK(SessionStore(db.writer).open(test::describe(id), 1));
  ASSERT_OK(SessionStore(db.writer).append(id, 0, test::chunkOf(0)));
  ASSERT_OK(SessionStore(db.writer).close(test::closeOf(id, 1), 400 * test::kDay_ns));
  EXPECT_EQ(latest(), 3 * test::kDay_ns);
}

TEST_F(SeenTimeTest, aSlowClockIsReportedWithBothTimes) {
  ASSERT_OK(seen.note(400 * test::kDay_ns));
  EXPECT_EQ(test::TestDb::must(seen.behindText(400 * test::kDay_ns - kClockSlack_ns)), "");
  const std::string text = test::TestDb::must(seen.behindText(20 * test::kDay_ns));
  EXPECT_NE(text.find("1970-01-2"), std::string::npos) << text;
  EXPECT_NE(text.find("1971-02-0"), std::string::npos) << text;
}

}  // namespace
}  // namespace needlelab
