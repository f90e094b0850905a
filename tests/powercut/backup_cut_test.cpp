// Power cuts during a backup: a file with the backup's name is always a complete backup.
#include <gtest/gtest.h>

#include <cerrno>

#include "db/backup/backup.h"
#include "db/backup/check.h"
#include "tests/powercut/campaign.h"
#include "tests/powercut/watched_disk.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;

TEST(BackupCut, whatHasTheBackupsNameIsWhole) {
  const std::uint64_t seed = seedOr(20261123);
  constexpr std::uint64_t kChunks = 120;
  TestDb db;
  Uuid id{};
  id[15] = 1;
  SessionStore store(db.writer);
  ASSERT_OK(store.open(describe(id), 1));
  for (std::uint64_t seq = 0; seq < kChunks; ++seq) ASSERT_OK(store.append(id, seq, chunkOf(seq, 200)));

  const TempFolder disk;  // a different disk from the database's
  const auto target = disk.path() / "monday.db";
  DiskLog log;
  {
    const Watching watching(disk.path(), log);
    Connection reader = db.reader();
    ASSERT_OK(backupTo(reader, target, nullptr, kMaxLogBytesOfBackup, kPlainCopyReserveBytes,
                       [](const char*, const char*) {
                         errno = EXDEV;
                         return -1;
                       }));
    log.mark("done");
  }
  std::size_t done = 0;
  while (log.events()[done].name != "done") ++done;
  std::uint64_t whole = 0, absent = 0;
  CutCounts counts;
  const auto judge = [&](const fs::path& left, std::size_t instant, Random&) -> std::string {
    const auto file = left / "monday.db";
    if (fs::exists(file)) {
      ++whole;
      auto opened = Connection::open(file, {});
      if (!opened) return opened.error().message;
      const auto check = checkDatabase(*opened);
      if (!check) return check.error().message;
      if (!check->ok()) return check->faults.front();
      if (check->chunks != kChunks) return "has " + std::to_string(check->chunks) + " chunks only";
      return {};
    }
    ++absent;
    if (instant > done) return "the backup that was reported as done is not there";
    // the leftovers do not block the next backup
    Connection reader = db.reader();
    const auto again = backupTo(reader, file);
    return again.ok() ? std::string() : again.error().message;
  };
  cutLog(log, log.begin(), log.events().size(), longForm() ? 400 : 16, seed, judge, counts);
  // where the name appears
  cutLog(log, done - 6, log.events().size(), longForm() ? 50 : 8, seed + 1, judge, counts);
  report("backup", counts);
  EXPECT_EQ(counts.bad, 0u) << counts.first;
  EXPECT_GT(whole, 0u);
  EXPECT_GT(absent, 0u);
}

}  // namespace
}  // namespace needlelab::test
