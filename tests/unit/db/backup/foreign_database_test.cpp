// Files that somebody else may have written: files beside them, their content, and how long they take.
#include "db/backup/foreign_database.h"

#include <gmock/gmock.h>
#include <sqlite3.h>
#include <sys/stat.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "db/backup/backup.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/db/shim_vfs.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// A rollback journal beside a database, as left by a crash while several databases were changed, in SQLite's
/// file format (https://www.sqlite.org/fileformat2.html, "The Rollback Journal"). Opening `database` as its
/// owner rolls the journal back and then deletes `victim`, which the journal names as its super-journal.
/// Returns the journal's path.
std::filesystem::path writeHotJournal(const std::filesystem::path& database,
                                      const std::filesystem::path& victim) {
  constexpr std::uint32_t kPage_bytes = 4096, kSector_bytes = 512, kPending_byte = 0x4000'0000;
  const std::string magic("\xd9\xd5\x05\xf9\x20\xa1\x63\xd7", 8), name = victim.string();
  const auto number = [](std::uint32_t value) {
    std::string bytes;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xffu);
    return bytes;
  };
  const auto pages = static_cast<std::uint32_t>(std::filesystem::file_size(database) / kPage_bytes);
  // no pages, nonce 0
  std::string text =
      magic + number(0) + number(0) + number(pages) + number(kSector_bytes) + number(kPage_bytes);
  text.resize(kSector_bytes, '\0');
  std::uint32_t sum = 0;
  for (const char c : name) sum += static_cast<unsigned char>(c);
  text += number(kPending_byte / kPage_bytes + 1) + name + number(static_cast<std::uint32_t>(name.size())) +
          number(sum) + magic;
  const std::filesystem::path journal = database.string() + "-journal";
  std::ofstream(journal, std::ios::binary) << text;
  return journal;
}

class ForeignDatabase : public testing::Test {
 protected:
  void SetUp() override {
    auto reader = db.reader();
    ASSERT_OK(backupTo(reader, path));
  }
  void change(const std::string& sql) {
    auto writer = test::TestDb::must(Connection::open(path, {.mode = Connection::Mode::kWriter}));
    ASSERT_OK(writer.script(sql));
    ASSERT_OK(writer.script("PRAGMA journal_mode=DELETE"));
  }
  /// Puts rows into the schema, as anyone who can write the file may: SQLite reads them when it opens the
  /// file next. `rows`: a SELECT of name and definition.
  void define(const std::string& rows) {
    change("PRAGMA writable_schema=ON; INSERT INTO sqlite_schema SELECT 'table', name, name, 2, sql FROM (" +
           rows + ")");
  }
  test::TestDb db;
  const test::TempFolder place;
  const fs::path path = place.path() / "backup 50% #1?.db";
  const fs::path victim = place.write("victim", "of somebody else");
};

TEST_F(ForeignDatabase, isReadAsItIsUnderAnyName) {
  auto opened = openForeign(path);
  ASSERT_OK(opened);
  const auto station = opened->prepare("SELECT name FROM stations").first(firstText);
  ASSERT_OK(station);
  EXPECT_EQ(*station, "station-1");
  EXPECT_FALSE(opened->run("DELETE FROM stations").ok());
  EXPECT_EQ(std::distance(fs::directory_iterator(place.path()), fs::directory_iterator()), 2)
      << "nothing was made beside it";
}

TEST_F(ForeignDatabase, isReadAlsoInAFolderThatALinkNames) {
  const test::TempFolder other;
  fs::create_directory_symlink(place.path(), other.path() / "link");
  EXPECT_OK(openForeign(other.path() / "link" / path.filename()));
}

TEST_F(ForeignDatabase, withAJournalIsRefusedAndNoFileIsDeleted) {
  const auto copy = place.path() / "control.db";
  fs::copy_file(path, copy);
  const auto of_copy = place.write("victim of the control", "x");
  writeHotJournal(copy, of_copy);
  auto own = Connection::open(copy, {});
  if (own.ok()) (void)own->prepare("SELECT count(*) FROM sessions").first(firstText);
  ASSERT_FALSE(fs::exists(of_copy)) << "the journal is hot, and a database of one's own obeys it";

  const auto journal = writeHotJournal(path, victim);
  const auto refused = openForeign(path);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(refused.error().message, HasSubstr(journal.string()));
  // one that appears after the check
  {
    auto opened = Connection::open(path, {.mode = Connection::Mode::kForeign});
    ASSERT_OK(opened);
    EXPECT_OK(opened->prepare("SELECT name FROM stations").first(firstText));
  }
  EXPECT_TRUE(fs::exists(victim));
  EXPECT_TRUE(fs::exists(journal));
}

TEST_F(ForeignDatabase, withALogIsRefusedUnlessTheLogIsEmpty) {
  const fs::path log = path.string() + "-wal";
  std::ofstream(log).close();
  EXPECT_OK(openForeign(path));
  std::ofstream(log) << "frames";
  EXPECT_EQ(openForeign(path).error().code, ErrorCode::kUnavailable);
}

TEST_F(ForeignDatabase, thatIsALinkOrAFolderOrNoneIsRefused) {
  fs::create_symlink(path, place.path() / "link.db");
  EXPECT_EQ(openForeign(place.path() / "link.db").error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(openForeign(place.path()).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(openForeign(place.path() / "none.db").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(openForeign(victim).error().code, ErrorCode::kCorrupt);
}

TEST_F(ForeignDatabase, withItsOwnViewIsRefusedBeforeAnyQuery) {
  change(
      "CREATE VIEW endless AS WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"
      " SELECT i FROM n");
  const auto refused = openForeign(path);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(refused.error().message, HasSubstr("view 'endless'"));
}

// Checking the name cannot tell what is there when SQLite opens it.
TEST_F(ForeignDatabase, aPipeSwappedInAfterTheCheckIsNotWaitedFor) {
  const auto pipe = place.path() / "pipe.db";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  // with a custom VFS nothing is checked before
  auto opened = Connection::open(pipe, {.mode = Connection::Mode::kForeign, .vfs = test::ShimVfs::name()});
  EXPECT_FALSE(opened.ok() && opened->prepare("SELECT name FROM stations").first(firstText).ok());
}

/// The peak of SQLite's heap while `work` runs, above its initial size, in bytes.
template <typename Work>
std::int64_t heapOf(const Work& work) {
  const std::int64_t before = sqlite3_memory_used();
  sqlite3_memory_highwater(1);
  work();
  return sqlite3_memory_highwater(0) - before;
}

/// Per byte of a definition.
constexpr std::int64_t kMostHeapBytesOfAByte = 100;
constexpr std::int64_t kOfSchema_bytes =
    static_cast<std::int64_t>(ForeignSchemaBounds::kMostBytes) + ForeignSchemaBounds::kMaxTextBytes;

TEST_F(ForeignDatabase, aSchemaThatWouldFillMemoryIsGivenUpWithinTheBounds) {
  struct Case {
    const char* what;
    std::string rows;
    std::int64_t most_bytes;
  };
  const auto list = [](const std::string& ones) {
    return "'x' || i AS name, 'CREATE TABLE x' || i || '(a DEFAULT (1 IN (' || replace(hex(zeroblob(" + ones +
           ")), '00', '1,') || '1)))' AS sql FROM n";
  };
  const std::string numbers = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < ";
  constexpr std::int64_t kPages_bytes = 4 << 20;  // also the program's own schema, and pages
  for (const Case& one :
       {Case{"one definition of 4 MB", numbers + "1) SELECT " + list("2000000"), kPages_bytes},
        Case{"100 of 60 kB", numbers + "100) SELECT " + list("30000"),
             kOfSchema_bytes * kMostHeapBytesOfAByte + kPages_bytes},
        Case{"40,000 of 30 bytes",
             numbers + "40000) SELECT 'x' || i AS name, 'CREATE TABLE x' || i || '(a)' AS sql FROM n",
             static_cast<std::int64_t>(ForeignSchemaBounds::kMostRows) * 1000 + kPages_bytes},
        // each UNIQUE has as many columns as the primary key
        Case{"a key of 1,000 columns and 1,000 more with it",
             numbers + "1000) SELECT 'x' AS name, 'CREATE TABLE x(' || group_concat('c' || i || ' UNIQUE') ||"
                       " ', PRIMARY KEY(' || group_concat('c' || i) || ')) WITHOUT ROWID' AS sql FROM n",
             kPages_bytes},
        Case{"20 of a key of 85 columns, and UNIQUE for each pair of them",
             numbers + "85), m(j) AS (SELECT 1 UNION ALL SELECT j + 1 FROM m WHERE j < 20)"
                       " SELECT 'x' || j AS name, 'CREATE TABLE x' || j || '(' ||"
                       " (SELECT group_concat('c' || i) FROM n) || ', PRIMARY KEY(' ||"
                       " (SELECT group_concat('c' || i) FROM n) || ')' || (SELECT group_concat("
                       "', UNIQUE(c' || a.i || ',c' || b.i || ')', '') FROM n a, n b WHERE a.i < b.i) ||"
                       " ') WITHOUT ROWID' AS sql FROM m",
             kOfSchema_bytes * kMostHeapBytesOfAByte + kPages_bytes}}) {
    SCOPED_TRACE(one.what);
    fs::remove(path);
    auto reader = db.reader();
    ASSERT_OK(backupTo(reader, path));
    define(one.rows);
    Result<Connection> opened = Error{ErrorCode::kFailed, "not asked"};
    const std::int64_t heap = heapOf([&] { opened = openForeign(path); });
    ASSERT_FALSE(opened.ok());
    EXPECT_EQ(opened.error().code, ErrorCode::kCorrupt) << opened.error().message;
    EXPECT_THAT(opened.error().message, HasSubstr(path.string()));
    EXPECT_LT(heap, one.most_bytes);
  }
}

TEST_F(ForeignDatabase, theProgramsOwnSchemaStaysFarBelowTheBounds) {
  auto row = db.writer.prepare(
      "SELECT count(*), max(length(sql)), sum(length(type) + length(name) + length(tbl_name) +"
      " coalesce(length(sql), 0)),"
      " (SELECT max(c) FROM (SELECT count(*) AS c FROM sqlite_schema s, pragma_table_info(s.name)"
      " WHERE s.type = 'table' GROUP BY s.name)) FROM sqlite_schema");
  ASSERT_TRUE(*row.step());
  // SQLite reads it once, the comparison a second time
  EXPECT_LT(2 * row.natural(0), ForeignSchemaBounds::kMostRows / 4);
  EXPECT_LT(row.integer(1), ForeignSchemaBounds::kMaxTextBytes / 4);
  EXPECT_LT(2 * row.natural(2), ForeignSchemaBounds::kMostBytes / 4);
  EXPECT_GT(row.integer(3), 20);
  EXPECT_LT(row.integer(3), ForeignSchemaBounds::kMaxColumns / 2);
  change("ANALYZE");
  EXPECT_OK(openForeign(path));
}

TEST_F(ForeignDatabase, keepsNoMorePagesInMemoryThanOurOwn) {
  constexpr std::int64_t kRows = 5000, kText_bytes = 3900;
  change("PRAGMA default_cache_size=1000000");  // in its header
  change("WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < " + std::to_string(kRows) +
         ") INSERT INTO audit (unix_ns, who, action, subject, detail) SELECT 1, '', '', '', printf('%.*c', " +
         std::to_string(kText_bytes) + ", '.') FROM n");
  auto opened = openForeign(path);
  ASSERT_OK(opened);
  std::int64_t rows = 0;
  const std::int64_t heap = heapOf([&] {
    auto all = opened->prepare("SELECT detail FROM audit");
    while (*all.step()) rows += all.bytes(0).size() == kText_bytes ? 1 : 0;
  });
  EXPECT_EQ(rows, kRows);
  EXPECT_LT(heap, kRows * kText_bytes / 4);
}

TEST_F(ForeignDatabase, aTextThatIsLongerThanWeStoreIsNotRead) {
  const std::string text = "printf('%.*c', " + std::to_string(kMaxForeignTextBytes + 1) + ", '.')";
  change("INSERT INTO meta (key, value) VALUES ('long', " + text + ")");
  auto opened = openForeign(path);
  ASSERT_OK(opened);
  const auto read = opened->prepare("SELECT value FROM meta WHERE key = 'long'").first(firstText);
  ASSERT_FALSE(read.ok());
  EXPECT_EQ(read.error().code, ErrorCode::kInvalidInput);
  EXPECT_OK(opened->prepare("SELECT name FROM stations").first(firstText));
}

TEST_F(ForeignDatabase, keepsTheCheckedSchemaDespiteConcurrentWrites) {
  change(
      "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 2000)"
      " INSERT INTO audit (unix_ns, who, action, subject, detail)"
      " SELECT 1, '', '', '', printf('%.*c', 3900, '.') FROM n");
  auto opened = openForeign(path);
  ASSERT_OK(opened);
  // more pages than fit in memory
  ASSERT_OK(opened->prepare("SELECT detail FROM audit").run());
  change("CREATE VIEW hostile AS SELECT 1 AS one");
  const auto asked = opened->prepare("SELECT one FROM hostile").first(firstText);
  ASSERT_FALSE(asked.ok());
  EXPECT_THAT(asked.error().message, HasSubstr("no such table: hostile"));
}

TEST_F(ForeignDatabase, endsAReadThatTakesTooLong) {
  const std::string endless =
      "WITH RECURSIVE n (i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i FROM n WHERE i < 0";
  test::FakeTime time;
  auto late = openForeign(path, nullptr, kMaxTimeOfForeign, time);
  ASSERT_OK(late);
  const std::int64_t began_ns = time.peekNs();
  time.read_cost_ns = 1'000'000;  // each clock read
  const auto given_up = late->prepare(endless).first(firstText);
  ASSERT_FALSE(given_up.ok());
  EXPECT_EQ(given_up.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(given_up.error().message, HasSubstr("takes too long"));
  EXPECT_LE(time.peekNs() - began_ns,
            std::chrono::nanoseconds(kMaxTimeOfForeign).count() + time.read_cost_ns);

  std::atomic<bool> ends = false;
  auto cancelled = openForeign(path, &ends);
  ASSERT_OK(cancelled);
  ends = true;
  EXPECT_FALSE(cancelled->prepare(endless).first(firstText).ok());
}

TEST(BackupBeside, noFileInTheBackupsFolderIsOpenedAsADatabase) {
  test::TestDb db;
  const test::TempFolder elsewhere;
  const auto target = elsewhere.path() / "monday.db";
  // like a loop run by somebody else who may write there
  auto reader = db.reader();
  const auto other_disk = [](const char* from, const char* to) {
    const fs::path partial(to);
    std::ofstream(partial.string() + "-journal") << "of somebody else " << from;
    errno = EXDEV;
    return -1;
  };
  const auto result =
      backupTo(reader, target, nullptr, kMaxLogBytesOfBackup, kPlainCopyReserveBytes, other_disk);
  ASSERT_OK(result);
  EXPECT_EQ(result->bytes, fs::file_size(target));
  EXPECT_OK(openForeign(target));
  EXPECT_FALSE(fs::exists(plainCopyPath(db.path)));
  EXPECT_FALSE(fs::exists(target.string() + ".partial"));
  EXPECT_EQ(
      backupTo(reader, elsewhere.path() / "tuesday.db", nullptr, kMaxLogBytesOfBackup, std::uint64_t{1} << 60)
          .error()
          .code,
      ErrorCode::kNoRoom);
}

}  // namespace
}  // namespace needlelab
