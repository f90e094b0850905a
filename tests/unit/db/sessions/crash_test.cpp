// Processes crash and power fails while chunks arrive: all acknowledged data must survive.
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <functional>
#include <random>
#include <thread>

#include "db/backup/check.h"
#include "db/sessions/db_writer.h"
#include "db/store/connection.h"
#include "tests/unit/db/shim_vfs.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;
using test::chunkOf;
using test::closeOf;
using test::describe;

constexpr int kSessions = 4;

Uuid idOf(int session) {
  Uuid id{};
  id[15] = static_cast<std::uint8_t>(session + 1);
  return id;
}

/// Opens the sessions and appends chunks forever. After each commit it writes one byte per chunk, the
/// session's number, to `acks`.
[[noreturn]] void storeForEver(const std::filesystem::path& path, int acks) {
  auto connection = Connection::open(path, {.mode = Connection::Mode::kWriter});
  if (!connection) ::_exit(3);
  std::uint64_t next[kSessions];
  {
    auto transaction = Transaction::begin(*connection, Transaction::Kind::kWrite);
    for (int s = 0; s < kSessions; ++s) {
      const auto seq = SessionStore(*connection).open(describe(idOf(s)), 1);
      if (!seq) ::_exit(4);
      next[s] = *seq;
    }
    if (!transaction || !transaction->commit()) ::_exit(4);
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
    // Waits for the first acknowledgement, so that the kill interrupts work, then for a random time.
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
      // The bytes are correct.
      const auto chunks = SessionStore(connection).readChunks(idOf(s), 0, UINT32_MAX, SIZE_MAX);
      ASSERT_OK(chunks);
      ASSERT_EQ(chunks->size(), *stored);
      for (const StoredChunk& chunk : *chunks) ASSERT_EQ(chunk.bytes, chunkOf(chunk.seq));
      acknowledged[s] = *stored;  // stored without an acknowledgement: the next child continues after it
    }
    total = acknowledged[0] + acknowledged[1] + acknowledged[2] + acknowledged[3];
  }
  EXPECT_GT(total, 20u) << "hardly anything was stored: the test tests nothing";
}

/// Repeats `commit` in transactions and calls `committed` after each, until the power is cut at a random disk
/// operation. Checks that the remaining database passes every check, and passes it to `look`.
void cutThePower(std::uint64_t seed, bool full, const std::function<void(Connection&)>& commit,
                 const std::function<void()>& committed, const std::function<void(Connection&)>& look) {
  auto& vfs = test::ShimVfs::instance();
  std::mt19937_64 random(seed);
  vfs.startRecording();
  test::TestDb db(test::ShimVfs::name());
  if (!full) EXPECT_OK(db.writer.script("PRAGMA synchronous=NORMAL"));

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
  // like DbWriter: commits, with occasional checkpoints between them
  std::uint64_t round = 0;
  while (!cut) {
    auto transaction = Transaction::begin(db.writer, Transaction::Kind::kWrite);
    EXPECT_OK(transaction);
    commit(db.writer);
    EXPECT_OK(transaction->commit());
    if (!cut) committed();
    if (!cut && round++ % 7 == 6) EXPECT_OK(db.writer.checkpointPassive());
  }
  vfs.setHook({});

  auto left = test::TestDb::must(
      Connection::open(after.path() / "needlelab.db", {.mode = Connection::Mode::kWriter}));
  const auto check = checkDatabase(left);
  EXPECT_OK(check);
  EXPECT_TRUE(check->ok()) << "seed " << seed << ": " << check->faults.front();
  look(left);
}

/// Returns the number of acknowledged chunks of one session that are missing after a power cut. check()
/// verifies its counters.
std::uint64_t lostByPowerCut(std::uint64_t seed, bool full) {
  std::uint64_t acknowledged = 0, seq = 0, there = 0;
  cutThePower(
      seed, full,
      [&](Connection& writer) {
        if (seq == 0) {
          EXPECT_OK(SessionStore(writer).open(describe(idOf(0)), 1));
        }
        EXPECT_OK(SessionStore(writer).append(idOf(0), seq, chunkOf(seq)));
        ++seq;
      },
      [&] { acknowledged = seq; },
      [&](Connection& left) {
        const auto stored = SessionStore(left).nextSeq(idOf(0));
        there = stored.ok() ? *stored : 0;
      });
  return acknowledged > there ? acknowledged - there : 0;
}

TEST(Crash, aPowerCutDuringAClosePreservesAConsistentSession) {
  // each session: opened, a chunk, a chunk, closed, each in its own commit
  constexpr int kSteps = 4;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    int step = 0, acknowledged = 0;
    cutThePower(
        seed, true,
        [&](Connection& writer) {
          SessionStore store(writer);
          const int session = step / kSteps;
          const auto at = static_cast<std::uint64_t>(step % kSteps);
          if (at == 0) {
            EXPECT_OK(store.open(describe(idOf(session)), 1));
          } else if (at < 3) {
            EXPECT_OK(store.append(idOf(session), at - 1, chunkOf(at - 1)));
          } else {
            EXPECT_EQ(store.close(closeOf(idOf(session), 2), 2)->kind, Closed::Kind::kClosed);
          }
          ++step;
        },
        [&] { acknowledged = step; },
        [&](Connection& left) {
          for (int session = 0; session * kSteps < acknowledged; ++session) {
            const auto info = SessionStore(left).info(idOf(session));
            ASSERT_OK(info);
            const int done = std::min(acknowledged - session * kSteps, kSteps);
            EXPECT_GE(info->chunks(), static_cast<std::uint64_t>(std::clamp(done - 1, 0, 2)));
            EXPECT_EQ(info->samples(), 20 * info->chunks());
            if (done == kSteps) {
              EXPECT_EQ(info->state(), pb::SESSION_COMPLETE);
            }
          }
        });
  }
}

TEST(Crash, aPowerCutLosesNothingAcknowledged) {
  for (std::uint64_t seed = 0; seed < 40; ++seed)
    EXPECT_EQ(lostByPowerCut(seed, true), 0u) << "seed " << seed;
}

TEST(Crash, theSamePowerCutsDoLoseDataWithSynchronousNormal) {
  // Negative control: the simulated disk can lose data.
  std::uint64_t lost = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) lost += lostByPowerCut(seed, false);
  EXPECT_GT(lost, 0u);
}

}  // namespace
}  // namespace needlelab
