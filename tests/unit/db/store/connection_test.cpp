#include <atomic>
#include <fstream>
#include <string>
#include <utility>

#include "db/store/connection.h"
#include "tests/unit/db/shim_vfs.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

std::string pragma(Connection& connection, const std::string& name) {
  auto row = connection.prepare("PRAGMA " + name);
  EXPECT_TRUE(*row.step());
  return row.text(0);
}

TEST(Connection, hasTheSettingsOfTheDesign) {
  test::TestDb db;
  auto writer = test::TestDb::must(Connection::open(db.path, {.mode = Connection::Mode::kWriter}));
  auto reader = db.reader();
  for (Connection* connection : {&writer, &reader}) {
    EXPECT_EQ(pragma(*connection, "journal_mode"), "wal");
    EXPECT_EQ(pragma(*connection, "synchronous"), "2");
    EXPECT_EQ(pragma(*connection, "foreign_keys"), "1");
    EXPECT_EQ(pragma(*connection, "wal_autocheckpoint"), "0");
    EXPECT_EQ(pragma(*connection, "busy_timeout"), "5000");
  }
  EXPECT_EQ(pragma(writer, "query_only"), "0");
  EXPECT_EQ(pragma(reader, "query_only"), "1");
}

TEST(Connection, aLongReadIsAbortedAboveItsWalBound) {
  test::TestDb db;
  // more than ten million steps of SQLite's machine; a short read has less than a million
  const std::string a_long_read =
      "WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 1000000)"
      " SELECT count(*) FROM n";
  constexpr std::uint64_t kBound = 4u << 20;
  auto reader = test::TestDb::must(Connection::open(db.path, {.max_log_bytes = kBound}));
  {
    const auto view = Transaction::begin(reader, Transaction::Kind::kRead);
    ASSERT_OK(view);
    EXPECT_OK(reader.prepare(a_long_read).first(firstText));
    ASSERT_OK(db.writer.script("BEGIN"));
    for (int i = 0; i < 2'000; ++i)
      ASSERT_OK(
          db.writer.run("INSERT INTO audit (unix_ns, who, action, subject, detail) VALUES (1,'','','',?)",
                        std::string(4'000, 'x')));
    ASSERT_OK(db.writer.script("COMMIT"));
    ASSERT_GT(db.writer.walBytes(), kBound);
    EXPECT_FALSE(*db.writer.emptyLog(0)) << "the reader needs it";
    const auto given_up = reader.prepare(a_long_read).first(firstText);
    ASSERT_FALSE(given_up.ok());
    EXPECT_EQ(given_up.error().code, ErrorCode::kUnavailable);
    EXPECT_NE(given_up.error().message.find("the log beside the database has grown to"), std::string::npos)
        << given_up.error().message;
    EXPECT_FALSE(reader.damaged());
  }
  EXPECT_OK(reader.prepare("SELECT count(*) FROM people").first(firstText));
  EXPECT_TRUE(*db.writer.emptyLog(0));
  EXPECT_OK(reader.prepare(a_long_read).first(firstText));
  // the writer's own reads continue
  ASSERT_OK(db.writer.run("UPDATE audit SET detail = detail || 'y'"));
  ASSERT_GT(db.writer.walBytes(), kBound);
  EXPECT_OK(db.writer.prepare(a_long_read).first(firstText));
}

TEST(Connection, aFlagCancelsALongReadAndOnlyWithinItsScope) {
  test::TestDb db;
  const std::string a_long_read =
      "WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 100000)"
      " SELECT count(*) FROM n";
  auto reader = db.reader();
  const std::atomic<bool> cancelled = true;
  {
    const CancelScope may_end(reader, &cancelled);
    EXPECT_FALSE(reader.prepare(a_long_read).first(firstText).ok());
    const CancelScope without_a_flag(reader, nullptr);
    EXPECT_FALSE(reader.prepare(a_long_read).first(firstText).ok());
  }
  EXPECT_OK(reader.prepare(a_long_read).first(firstText));
}

TEST(Connection, onlyTheWriterCheckpoints) {
  test::TestDb db;
  ASSERT_OK(db.writer.checkpointPassive());
  const auto size = std::filesystem::file_size(db.path);
  // far more than SQLite's own limit of 1,000 pages
  ASSERT_OK(db.writer.script("BEGIN"));
  for (int i = 0; i < 2'000; ++i) {
    ASSERT_OK(db.writer.run("INSERT INTO audit (unix_ns, who, action, subject, detail) VALUES (1,'','','',?)",
                            std::string(4'000, 'x')));
  }
  ASSERT_OK(db.writer.script("COMMIT"));
  { auto reader = db.reader(); }
  {
    Connection closing = std::move(db.writer);  // the last connection, closed
  }
  EXPECT_EQ(std::filesystem::file_size(db.path), size);
  EXPECT_GT(std::filesystem::file_size(db.path.string() + "-wal"), 8'000'000u);

  auto writer = test::TestDb::must(Connection::open(db.path, {.mode = Connection::Mode::kWriter}));
  ASSERT_OK(writer.checkpointPassive());
  EXPECT_GT(std::filesystem::file_size(db.path), 8'000'000u);
}

TEST(Connection, aMissingDatabaseIsNamed) {
  const test::TempFolder folder;
  const auto missing = Connection::open(folder.path() / "none.db", {});
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
  EXPECT_NE(missing.error().message.find("none.db"), std::string::npos);
}

TEST(Connection, aCopysErrorsNameItsOriginAndDiskErrorsItsPath) {
  const test::TempFolder folder;
  const auto path = folder.write("copy.db", std::string(5'000, 'x'));
  const auto refused =
      Connection::open(path, {.mode = Connection::Mode::kWriter, .copy_of = "/backups/monday.db"});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(refused.error().message.rfind("/backups/monday.db: cannot ", 0), 0u) << refused.error().message;
  EXPECT_EQ(refused.error().message.find("copy.db"), std::string::npos) << refused.error().message;

  std::filesystem::remove(path);
  auto writer = test::TestDb::must(Connection::open(path, {.mode = Connection::Mode::kWriter,
                                                           .create = true,
                                                           .vfs = test::ShimVfs::name(),
                                                           .copy_of = "/backups/monday.db"}));
  auto& disk = test::ShimVfs::instance();
  disk.setHook([](test::ShimVfs::Op op, const std::string&, std::int64_t, int) {
    return op == test::ShimVfs::Op::kWrite ? SQLITE_FULL : SQLITE_OK;
  });
  const auto full = writer.script("CREATE TABLE t (a)");
  disk.setHook({});
  ASSERT_FALSE(full.ok());
  EXPECT_EQ(full.error().message.rfind(path.string() + ": cannot ", 0), 0u) << full.error().message;
}

TEST(Connection, aFileThatIsNoDatabaseIsCorrupt) {
  const test::TempFolder folder;
  const auto path = folder.write("text.db", std::string(5'000, 'x'));
  const auto refused = Connection::open(path, {.mode = Connection::Mode::kWriter});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt);
}

TEST(Connection, aBrokenConstraintSaysItsKind) {
  test::TestDb db;
  for (const auto& [sql, kind] : {
           std::pair{"INSERT INTO stations (name, key_hash, created_unix_ns) VALUES ('x', zeroblob(32), 'y')",
                     ErrorCode::kInvalidInput},
           {"INSERT INTO chunks (session, seq, samples, crc, bytes) VALUES (7, 0, 1, 1, x'00')",
            ErrorCode::kNotFound},
       }) {
    const auto refused = db.writer.run(sql);
    ASSERT_FALSE(refused.ok()) << sql;
    EXPECT_EQ(refused.error().code, kind) << sql;
    EXPECT_FALSE(db.writer.damaged()) << sql;
  }
}

TEST(Statement, bindsAndReadsEveryKindOfValue) {
  test::TestDb db;
  const Bytes bytes = {0, 1, 0, 255};
  const std::string text("a\0b", 3);
  auto row = db.writer.query("SELECT ?, ?, ?, ?, ?, ?, ?, ?", INT64_MIN, 0.1, text, ByteView(bytes),
                             std::optional<std::string>(), std::string_view(), ByteView(), true);
  ASSERT_TRUE(*row.step());
  EXPECT_EQ(row.integer(0), INT64_MIN);
  EXPECT_EQ(row.natural(0), 0u);
  EXPECT_EQ(row.real(1), 0.1);
  EXPECT_EQ(row.text(2), text);
  EXPECT_EQ(Bytes(row.bytes(3).begin(), row.bytes(3).end()), bytes);
  EXPECT_TRUE(row.isNull(4));
  EXPECT_FALSE(row.isNull(5));
  EXPECT_FALSE(row.isNull(6));
  EXPECT_EQ(row.integer(7), 1);
  EXPECT_FALSE(*row.step());
}

TEST(Statement, failuresToPrepareAndBindComeOutOfStep) {
  test::TestDb db;
  auto nonsense = db.writer.query("SELEKT ?", 1);
  EXPECT_FALSE(nonsense.step().ok());
  auto too_many = db.writer.query("SELECT ?", 1, 2);
  EXPECT_FALSE(too_many.step().ok());
  auto too_big = db.writer.query("SELECT ?", UINT64_MAX);
  const auto refused = too_big.step();
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
}

TEST(Statement, valuesOfAnEarlierUseAreForgotten) {
  test::TestDb db;
  { ASSERT_TRUE(*db.writer.query("SELECT ?", "secret").step()); }
  auto row = db.writer.prepare("SELECT ?");
  ASSERT_TRUE(*row.step());
  EXPECT_TRUE(row.isNull(0));
}

std::int64_t stations(Connection& connection) {
  auto row = connection.prepare("SELECT count(*) FROM stations");
  EXPECT_TRUE(*row.step());
  return row.integer(0);
}

Status add(Connection& connection, const std::string& name) {
  return StationStore(connection).add(name, StationKeyBytes{}, 1);
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

}  // namespace

}  // namespace needlelab
