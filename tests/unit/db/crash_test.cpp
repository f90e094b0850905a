// Processes that die and power that fails while chunks come in: what was acknowledged is there afterwards.
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <random>
#include <thread>

#include "db/check.h"
#include "db/db_writer.h"
#include "db/transaction.h"
#include "shim_vfs.h"
#include "test_db.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;
using test::chunkOf;
using test::describe;

constexpr int kSessions = 4;

Uuid idOf(int session) {
  Uuid id{};
  id[15] = static_cast<std::uint8_t>(session + 1);
  return id;
}

/// Opens the sessions and appends chunks for ever; after each commit writes one byte a chunk, the session's
/// number, to `acks`.
[[noreturn]] void storeForEver(const std::filesystem::path& path, int acks) {
  auto connection = Connection::open(path, {.mode = Connection::Mode::kWriter});
  if (!connection) ::_exit(3);
  std::uint64_t next[kSessions];
  for (int s = 0; s < kSessions; ++s) {
    const auto seq = SessionStore(*connection).open(describe(idOf(s)), 1);
    if (!seq) ::_exit(4);
    next[s] = *seq;
  }
  DbWriter writer(std::move(*connection), {.window = 2ms, .checkpoint_every = 10ms}, {});
  std::atomic<int> in_flight = 0;
  for (;;) {
    for (int s = 0; s < kSessions; ++s) {
      while (in_flight >= 64) std::this_thread::yield();
      ++in_flight;
      const std::uint64_t seq = next[s]++;
      auto posted = writer.post(
          [s, seq](Connection& c) {
            const auto appended = SessionStore(c).append(idOf(s), seq, chunkOf(seq));
            return appended.ok() && appended->taken() ? Status()
                                                      : Status(Error{ErrorCode::kFailed, "not taken"});
          },
          [s, acks, &in_flight](const Status& status) {
            const auto byte = static_cast<std::uint8_t>(s);
            if (!status.ok() || ::write(acks, &byte, 1) != 1) ::_exit(5);
            --in_flight;
          });
      if (!posted) ::_exit(6);
    }
  }
}

TEST(Crash, whatWasAcknowledgedOutlivesKillNine) {
  test::TestDb db;
  { Connection closed = std::move(db.writer); }
  std::mt19937_64 random(7);
  std::uint64_t acknowledged[kSessions] = {};
  std::uint64_t total = 0;
  for (int kill = 0; kill < 5; ++kill) {
    int pipe_ends[2];
    ASSERT_EQ(::pipe(pipe_ends), 0);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      ::close(pipe_ends[0]);
      storeForEver(db.path, pipe_ends[1]);
    }
    ::close(pipe_ends[1]);
    // wait for the first acknowledgement, so that the kill falls into work, then for a random time
    std::uint8_t byte = 0;
    ASSERT_EQ(::read(pipe_ends[0], &byte, 1), 1) << "the child ended early";
    ++acknowledged[byte];
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 60'000));
    ASSERT_EQ(::kill(child, SIGKILL), 0);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status)) << "exit code " << WEXITSTATUS(status);
    while (::read(pipe_ends[0], &byte, 1) == 1) {
      ASSERT_LT(byte, kSessions);
      ++acknowledged[byte];
    }
    ::close(pipe_ends[0]);

    auto connection = test::TestDb::must(Connection::open(db.path, {.mode = Connection::Mode::kWriter}));
    const auto check = checkDatabase(connection);
    ASSERT_OK(check);
    EXPECT_TRUE(check->ok()) << check->faults.front();
    for (int s = 0; s < kSessions; ++s) {
      const auto stored = SessionStore(connection).nextSeq(idOf(s));
      ASSERT_OK(stored);
      EXPECT_GE(*stored, acknowledged[s]) << "session " << s << ", kill " << kill;
      // and they are the right bytes
      const auto chunks = SessionStore(connection).readChunks(idOf(s), 0, UINT32_MAX, SIZE_MAX);
      ASSERT_OK(chunks);
      ASSERT_EQ(chunks->size(), *stored);
      for (const StoredChunk& chunk : *chunks) ASSERT_EQ(chunk.bytes, chunkOf(chunk.seq));
      acknowledged[s] = *stored;  // stored without an acknowledgement: the next child goes on after it
    }
    total = acknowledged[0] + acknowledged[1] + acknowledged[2] + acknowledged[3];
  }
  EXPECT_GT(total, 20u) << "hardly anything was stored: the test tests nothing";
}

/// Cuts the power at a random operation on the disk, and looks at what is left. Gives how many acknowledged
/// chunks are missing.
std::uint64_t lostByPowerCut(std::uint64_t seed, bool full) {
  auto& vfs = test::ShimVfs::instance();
  std::mt19937_64 random(seed);
  vfs.startRecording();
  test::TestDb db(test::ShimVfs::name());
  if (!full) EXPECT_OK(db.writer.script("PRAGMA synchronous=NORMAL"));
  EXPECT_OK(SessionStore(db.writer).open(describe(idOf(0)), 1));

  const test::TempFolder after;
  std::uint64_t operations_left = 20 + random() % 200;
  bool cut = false;
  vfs.setHook([&](test::ShimVfs::Op, const std::string&, std::int64_t, int) {
    if (!cut && --operations_left == 0) {
      vfs.writeAfterPowerCut(after.path(), random);
      cut = true;
    }
    return SQLITE_OK;
  });
  // as DbWriter does: commits, and a checkpoint now and then between them
  std::uint64_t committed = 0;
  std::uint64_t seq = 0;
  while (!cut) {
    auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWrite);
    EXPECT_OK(transaction);
    EXPECT_OK(SessionStore(db.writer).append(idOf(0), seq, chunkOf(seq)));
    EXPECT_OK(transaction->commit());
    if (!cut) committed = seq + 1;
    if (!cut && seq % 7 == 6) EXPECT_OK(db.writer.checkpointPassive());
    ++seq;
  }
  vfs.setHook({});

  auto left = test::TestDb::must(
      Connection::open(after.path() / "needlelab.db", {.mode = Connection::Mode::kWriter}));
  const auto check = checkDatabase(left);
  EXPECT_OK(check);
  EXPECT_TRUE(check->ok()) << "seed " << seed << ": " << check->faults.front();
  const auto stored = SessionStore(left).nextSeq(idOf(0));
  const std::uint64_t there = stored.ok() ? *stored : 0;
  return committed > there ? committed - there : 0;
}

TEST(Crash, aPowerCutLosesNothingAcknowledged) {
  for (std::uint64_t seed = 0; seed < 40; ++seed)
    EXPECT_EQ(lostByPowerCut(seed, true), 0u) << "seed " << seed;
}

TEST(Crash, theSamePowerCutsDoLoseDataWithSynchronousNormal) {
  // the negative control: the simulated disk is able to lose
  std::uint64_t lost = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) lost += lostByPowerCut(seed, false);
  EXPECT_GT(lost, 0u);
}

}  // namespace
}  // namespace needlelab
