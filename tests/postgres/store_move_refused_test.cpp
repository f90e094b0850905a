// Copies between the engines that do not begin, do not continue, or do not end with a switch: the lab stays
// where it was.
#include <utility>

#include "tests/postgres/store_move_fixture.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;
using testing::Not;

TEST_F(StoreMoveTest, anUnfinishedCopyCannotBeOpened) {
  addSession(4);
  leaveUnfinished(5);
  EXPECT_TRUE(std::filesystem::exists(lab("needlelab.db")));
  const auto refused = Store::open(folder.path() / "other", {.store_url = url});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(refused.error().message, HasSubstr("unfinished copy"));
  // the command continues
  const Run there = copyTo();
  ASSERT_EQ(there.code, 0) << there.err;
  expectSound(true, 1);
}

TEST_F(StoreMoveTest, aCopyDoesNotGoOnOnceSomebodyWorkedWithTheSource) {
  addSession(4);
  leaveUnfinished(5);
  addSession(1);
  const Run refused = copyTo();
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("--begin-again"));
  const Run again = copyTo({"--begin-again"});
  ASSERT_EQ(again.code, 0) << again.err;
  expectSound(true, 2);
}

TEST_F(StoreMoveTest, theWayBackBeginsAgainAndRefusesInTheSameWay) {
  addSession(4);
  ASSERT_EQ(copyTo().code, 0);
  StoreMove move = toPostgres();
  move.to_postgres = false;
  int pages = 5;
  move.copy.on_progress = [&](const CopyProgress&) -> Status {
    return --pages > 0 ? Status() : Status(Error{ErrorCode::kUnavailable, "killed"});
  };
  ASSERT_FALSE(moveStore(move).ok());
  EXPECT_TRUE(std::filesystem::exists(lab(kCopyingDatabase)));
  expectSound(true, 1);  // meanwhile the lab works with the source
  EXPECT_EQ(copyBack().code, 2);
  const Run again = copyBack({"--begin-again"});
  ASSERT_EQ(again.code, 0) << again.err;
  expectSound(false, 1);
}

TEST_F(StoreMoveTest, aDatabaseThatIsNotEmptyIsRefusedAndLeftAlone) {
  addSession(1);
  { ASSERT_OK(Store::open(folder.path() / "other", {.store_url = url})); }
  const Run refused = copyTo();
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("is not empty"));
  EXPECT_EQ(copyTo({"--begin-again"}).code, 2) << "it is not an unfinished copy";
  expectSound(false, 1);
  ASSERT_OK(Store::open(folder.path() / "other", {}));
}

TEST_F(StoreMoveTest, aRowChangedDuringTheCopyCancelsTheMove) {
  addSession(2);
  StoreMove move = toPostgres();
  bool changed = false;
  move.copy.on_progress = [&](const CopyProgress& progress) -> Status {
    if (!progress.comparing || std::exchange(changed, true)) return {};
    ASSIGN_OR_RETURN(auto other, openAt(StoreAddress(lab("needlelab.db"), url), Connection::Mode::kWriter));
    return other.run("UPDATE sessions SET exercise_id = 'other'");
  };
  const auto moved = moveStore(move);
  ASSERT_FALSE(moved.ok());
  EXPECT_EQ(moved.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(moved.error().message,
              HasSubstr("sessions, number 1 has another value in the column exercise_id"));
  expectSound(false, 1);
}

TEST_F(StoreMoveTest, whoWorksWithOneOfTheTwoKeepsTheCopyFromBeginning) {
  addSession(1);
  {
    const auto server = Store::open(data(), {});
    ASSERT_OK(server);
    const Run refused = copyTo();
    EXPECT_EQ(refused.code, 1);
    EXPECT_THAT(refused.err, HasSubstr("a server is running"));
  }
  {
    const auto server = Store::open(folder.path() / "other", {.store_url = url});
    ASSERT_OK(server);
    const Run refused = copyTo();
    EXPECT_EQ(refused.code, 1);
    EXPECT_THAT(refused.err, HasSubstr("works on this database"));
  }
}

TEST_F(StoreMoveTest, aUserWithoutTableOwnershipIsRefusedBeforeCopying) {
  addSession(3);
  const PlainUser user(false);
  const Run refused = run({"store", "copy", "--from", data(), "--to", user.url()});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("of the schema needlelab belongs to 'needlelab'"));
  expectSound(false, 1);
}

TEST_F(StoreMoveTest, wrongFoldersAndAddressesAreNamed) {
  addSession(1);
  const auto refusal = [&](const std::string& from, const std::string& to) {
    const Run refused = run({"store", "copy", "--from", from, "--to", to});
    EXPECT_EQ(refused.code, 2) << refused.err;
    return refused.err;
  };
  EXPECT_THAT(refusal(data(), data()), HasSubstr("one of --from and --to"));
  EXPECT_THAT(refusal(url, url), HasSubstr("one of --from and --to"));
  EXPECT_THAT(refusal(file("none"), url), HasSubstr("is not a folder"));
  std::filesystem::create_directory(file("empty"));
  EXPECT_THAT(refusal(file("empty"), url), HasSubstr("no needlelab.db"));
  EXPECT_THAT(refusal(url, file("empty")), HasSubstr("The lab's keys lie in that folder"));
  EXPECT_THAT(refusal(url, data()), HasSubstr("has a database of its own"));
  const std::string hush = refusal(data(), "postgresql://anna:hush@127.0.0.1:1/lab");
  EXPECT_THAT(hush, HasSubstr("has a password"));
  EXPECT_THAT(hush, Not(HasSubstr("hush")));
  // another lab's database
  ASSERT_EQ(copyTo().code, 0);
  const std::string other = postgresUrlOf(folder.path() / "two");
  { ASSERT_OK(Store::open(folder.path() / "other", {.store_url = other})); }
  EXPECT_THAT(refusal(other, data()), HasSubstr("check the address"));
  EXPECT_THAT(refusal(data(), other), HasSubstr("is on PostgreSQL"));
  expectSound(true, 1);
}

}  // namespace
}  // namespace needlelab::test
