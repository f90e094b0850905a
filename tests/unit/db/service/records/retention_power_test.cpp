// The state after a power cut at any moment of a retention run.

#include <random>

#include "db/backup/check.h"
#include "db/sessions/session_rows.h"
#include "tests/unit/db/service/records/retention_fixture.h"
#include "tests/unit/db/shim_vfs.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;
using test::chunkOf;
using test::closeOf;
using test::expectedThinned;
using test::expectSame;
using test::kSamplesEach;
using test::samplesIn;

/// The power is cut at each sync of a whole run, on a disk that loses, reorders and tears what was not
/// synced. There is always one complete recording, the original or the thinned one, and the next run finishes
/// the work.
TEST(RetentionPower, aCutLeavesTheOriginalOrTheThinnedRecordingWhole) {
  constexpr std::uint64_t kLong = 200;  // its thinned recording has several chunks: cuts between them
  auto& vfs = test::ShimVfs::instance();
  vfs.startRecording();
  test::TestDb db(test::ShimVfs::name());
  const Uuid id = makeUuidV7();
  {
    SessionStore sessions(db.writer);
    ASSERT_OK(db.writer.script("BEGIN"));
    ASSERT_OK(sessions.open(test::describe(id), 1));
    for (std::uint64_t seq = 0; seq < kLong; ++seq)
      ASSERT_OK(sessions.append(id, seq, chunkOf(seq, kSamplesEach)));
    ASSERT_OK(sessions.close(closeOf(id, kLong, kSamplesEach), 1));
    ASSERT_OK(sessions.markSafe(id, kLong));
    pb::RetentionPolicy policy;
    policy.set_thin_after_days(1);
    policy.set_thin_rate_hz(500);
    policy.set_by("mia");
    ASSERT_OK(RetentionStore(db.writer).setPolicy(policy));
    ASSERT_OK(db.writer.script("COMMIT"));
  }
  const auto expected = expectedThinned(kLong, 500);
  const std::int64_t now = 100LL * 86'400 * 1'000'000'000;
  const std::atomic<bool> stop = false;
  // each step is its own commit
  const RetentionPace pace{.rows = 8, .bytes = 64, .pause = 0ms};
  const auto runOn = [&](DbWriter& writer, ReaderPool& readers) {
    return runRetention(
        {writer, readers, [](const Uuid&) { return Status(); }, [] { return false; }, stop, pace},
        {"retention"}, now, false);
  };

  const test::TempFolder cuts;
  int count = 0;
  std::mt19937_64 random(5);
  vfs.setHook([&](test::ShimVfs::Op op, const std::string&, std::int64_t, int) {
    if (op != test::ShimVfs::Op::kSync) return SQLITE_OK;
    const auto folder = cuts.path() / std::to_string(count++);
    std::filesystem::create_directory(folder);
    vfs.writeAfterPowerCut(folder, random);
    return SQLITE_OK;
  });
  {
    DbWriter writer(std::move(db.writer), {.window = 0ms, .checkpoint_every = 5ms}, {});
    ReaderPool readers(db.path);
    const auto report = runOn(writer, readers);
    ASSERT_OK(report);
    EXPECT_EQ(report->thinned(), 1u);
  }
  vfs.setHook({});
  ASSERT_GT(count, 10) << "hardly any piece was cut";

  int originals = 0, thinned = 0;
  for (int i = 0; i < count; ++i) {
    SCOPED_TRACE("cut " + std::to_string(i));
    const auto path = cuts.path() / std::to_string(i) / "needlelab.db";
    auto left = test::TestDb::must(Connection::open(path, {.mode = Connection::Mode::kWriter}));
    const auto check = checkDatabase(left);
    ASSERT_OK(check);
    ASSERT_TRUE(check->ok()) << check->faults.front();
    const auto info = SessionStore(left).info(id);
    ASSERT_OK(info);
    if (info->has_removed_original()) {
      ++thinned;
      expectSame(samplesIn(left, id), expected);
    } else {
      ++originals;
      const auto chunks = SessionStore(left).readChunks(id, 0, UINT32_MAX, SIZE_MAX);
      ASSERT_OK(chunks);
      ASSERT_EQ(chunks->size(), kLong);
      for (const StoredChunk& chunk : *chunks) ASSERT_EQ(chunk.bytes, chunkOf(chunk.seq, kSamplesEach));
    }
    ASSERT_OK(left.script("PRAGMA synchronous=OFF"));
    DbWriter writer(std::move(left), {.window = 0ms}, {});
    ReaderPool readers(path);
    ASSERT_OK(runOn(writer, readers));
    auto reader = readers.borrow();
    expectSame(samplesIn(**reader, id), expected);
    EXPECT_TRUE(RetentionStore(**reader).leftovers()->empty());
    EXPECT_TRUE(checkDatabase(**reader)->ok());
  }
  EXPECT_GT(originals, 3);
  EXPECT_GT(thinned, 3);
}

}  // namespace
}  // namespace needlelab
