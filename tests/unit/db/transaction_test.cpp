#include "db/transaction.h"

#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

std::int64_t stations(Connection& connection) {
  auto row = connection.prepare("SELECT count(*) FROM stations");
  EXPECT_TRUE(*row.step());
  return row.integer(0);
}

Status add(Connection& connection, const std::string& name) {
  return StationStore(connection).add(name, StationKeyBytes{}, 1);
}

TEST(Transaction, isUndoneUnlessCommitted) {
  test::TestDb db;
  {
    auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWrite);
    ASSERT_OK(transaction);
    ASSERT_OK(add(db.writer, "a"));
    EXPECT_EQ(stations(db.writer), 2);
  }
  EXPECT_EQ(stations(db.writer), 1);
  {
    auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWrite);
    ASSERT_OK(add(db.writer, "b"));
    ASSERT_OK(transaction->commit());
  }
  EXPECT_EQ(stations(db.writer), 2);
  EXPECT_FALSE(db.writer.inTransaction());
}

TEST(Transaction, aReadViewDoesNotChange) {
  test::TestDb db;
  auto reader = db.reader();
  const auto view = Transaction::begin(reader, Transaction::Kind::kRead);
  ASSERT_OK(view);
  ASSERT_OK(add(db.writer, "later"));
  EXPECT_EQ(stations(reader), 1);
}

TEST(Transaction, aViewIsOnesOwnOrTheOneThatIsThere) {
  test::TestDb db;
  auto reader = db.reader();
  {
    const auto view = Transaction::view(reader);
    ASSERT_OK(view);
    EXPECT_TRUE(view->has_value());
    ASSERT_OK(add(db.writer, "later"));
    EXPECT_EQ(stations(reader), 1) << "it does not change";
    {
      const auto inner = Transaction::view(reader);
      ASSERT_OK(inner);
      EXPECT_FALSE(inner->has_value());
    }
    EXPECT_TRUE(reader.inTransaction()) << "the inner one ended nothing";
    EXPECT_EQ(stations(reader), 1);
  }
  EXPECT_FALSE(reader.inTransaction());
  EXPECT_EQ(stations(reader), 2);
}

TEST(Savepoint, failsAlone) {
  test::TestDb db;
  auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWrite);
  ASSERT_OK(add(db.writer, "kept"));
  {
    auto savepoint = Savepoint::begin(db.writer);
    ASSERT_OK(savepoint);
    ASSERT_OK(add(db.writer, "undone"));
  }
  {
    auto savepoint = Savepoint::begin(db.writer);
    ASSERT_OK(add(db.writer, "kept too"));
    ASSERT_OK(savepoint->release());
  }
  ASSERT_OK(transaction->commit());
  EXPECT_EQ(stations(db.writer), 3);
}

}  // namespace
}  // namespace needlelab
