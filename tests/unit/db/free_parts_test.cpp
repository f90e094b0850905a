#include "db/free_parts.h"

#include <cstdint>
#include <filesystem>
#include <string>

#include "db/schema.h"
#include "tests/unit/db/dump.h"
#include "tests/unit/db/erasure_fixture.h"
#include "tests/unit/db/moved_rows.h"

namespace needlelab {
namespace {

using FreePartsTest = test::ErasureTest;

TEST_F(FreePartsTest, whatPagesKeepOfRowsThatMovedGoesTooAndNothingElse) {
  const Uuid open = session("anna", 2, false);
  session("ben", 3, true);
  test::MovedRows().fill(db.writer);
  const auto left = [&] {
    EXPECT_OK(db.writer.checkpointPassive());
    return test::MovedRows::leftIn(db.path);
  };
  EXPECT_GT(left(), 0u) << "secure_delete alone leaves names";
  const std::string before = test::dump(db.writer);
  FreeParts parts;
  ASSERT_OK(db.writer.run("UPDATE people SET changed_unix_ns = changed_unix_ns WHERE name = 'anna'"));
  const auto early = parts.clearSome(db.writer, 1000);
  ASSERT_OK(early);
  EXPECT_FALSE(*early) << "the log has pages";
  int pieces = 0;
  for (bool all = false; !all; ++pieces) {
    ASSERT_LT(pieces, 10'000);
    ASSERT_TRUE(*db.writer.emptyLog(0));
    const auto done = parts.clearSome(db.writer, 10);
    ASSERT_OK(done);
    all = *done;
    // commits go on between the pieces
    if (!all)
      ASSERT_OK(db.writer.run("UPDATE people SET changed_unix_ns = changed_unix_ns WHERE name = 'anna'"));
  }
  EXPECT_GT(pieces, 20) << "2000 names with some 350 bytes, ten pages in a piece";
  EXPECT_EQ(left(), 0u);
  EXPECT_TRUE(test::dump(db.writer) == before) << "no row is another";
  // keys and triggers hold again
  EXPECT_FALSE(db.writer.run("INSERT INTO group_members (group_id, person) VALUES ('none', 'nobody')").ok());
  EXPECT_OK(SessionStore(db.writer).append(open, 2, test::chunkOf(2)));
  EXPECT_OK(SessionStore(db.writer).close(test::closeOf(open, 3), 3));
  EXPECT_EQ(SessionStore(db.writer).info(open)->chunks(), 3u);
}

TEST_F(FreePartsTest, freePartsAreClearedWithoutRoomInTheLogAndTheDatabaseStaysSound) {
  session("ben", 5, true);
  ASSERT_TRUE(*db.writer.emptyLog(0));
  const auto bytes = std::filesystem::file_size(db.path);
  FreeParts parts;
  const auto done = parts.clearSome(db.writer, 100'000);
  ASSERT_OK(done);
  EXPECT_TRUE(*done);
  EXPECT_EQ(db.writer.walBytes(), 0u);
  EXPECT_EQ(std::filesystem::file_size(db.path), bytes);
  auto row = db.writer.prepare("PRAGMA integrity_check");
  ASSERT_TRUE(*row.step());
  EXPECT_EQ(row.text(0), "ok");
}

TEST_F(FreePartsTest, anErasureIsMarkedUntilTheFreePartsAreCleared) {
  ASSERT_OK(erase("anna"));
  EXPECT_EQ(*MetaStore(db.writer).get(kFreePartsKey), "erased-1234");
}

}  // namespace
}  // namespace needlelab
