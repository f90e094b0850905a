// Power cuts while the database's writer works: all acknowledged data are there, bit by bit, and work
// continues.
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <cerrno>
#include <map>

#include "db/backup/check.h"
#include "db/sessions/db_writer.h"
#include "db/store/connection.h"
#include "tests/powercut/campaign.h"
#include "tests/powercut/watched_disk.h"
#include "tests/unit/db/test_db.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

Uuid idOf(std::uint64_t session) {
  Uuid id{};
  id[14] = static_cast<std::uint8_t>(session >> 8);
  id[15] = static_cast<std::uint8_t>(session & 0xFF);
  return id;
}

/// The bytes of chunk `seq` of a session: different in every session, with very different lengths.
Bytes chunkFor(std::uint64_t session, std::uint64_t seq) {
  Random random(session * 1'000'003 + seq);
  const std::size_t count = random.chance(0.1) ? 200 + random.below(300) : 1 + random.below(40);
  return encodeChunk(Resolution{}, someSamples(session * 100'000 + seq * 1'000, count));
}

// a mark's number
std::uint64_t chunkMark(std::uint64_t session, std::uint64_t seq) {
  return session * 1'000'000 + seq;
}

/// A session's chunks so far.
struct Given {
  std::uint64_t chunks = 0, samples = 0;
  SessionHash hash;
  bool closed = false;
};

/// A load on a database through DbWriter: sessions opened, chunks, repeated chunks, closes; groups of
/// several, checkpoints after each commit or rarely, readers that delay a checkpoint, restarts of the writer.
/// The same seed gives the same disk calls, because the writer takes only full groups.
class Load {
 public:
  Load(std::uint64_t seed, DiskLog& log, std::filesystem::path path)
      : random_(seed), log_(log), path_(std::move(path)) {}

  /// Returns the writer's failure, if any.
  std::optional<Error> run(int segments) {
    for (int i = 0; i < segments; ++i) {
      if (auto error = segment(); error) return error;
    }
    return std::nullopt;
  }

 private:
  std::optional<Error> segment() {
    auto opened = Connection::open(path_, {.mode = Connection::Mode::kWriter});
    if (!opened) return opened.error();
    DbWriter::Options options;
    options.window = 60s;  // a group is taken when it is full
    options.max_group = 1 + random_.below(6);
    options.checkpoint_every = random_.chance(0.6) ? 0ms : std::chrono::milliseconds(1h);
    // a reader with an old view: checkpoints stop there, and the log keeps growing
    std::optional<Connection> reader;
    std::optional<Transaction> view;
    if (random_.chance(0.3)) {
      reader.emplace(TestDb::must(Connection::open(path_, {})));
      view.emplace(TestDb::must(Transaction::begin(*reader, Transaction::Kind::kRead)));
    }
    DbWriter writer(std::move(*opened), options, {});
    const std::uint64_t groups = 2 + random_.below(7);
    for (std::uint64_t g = 0; g < groups && !writer.failed(); ++g) {
      for (std::size_t i = 0; i < options.max_group; ++i) post(writer);
      // each group completes before the next, so that the calls are the same in the same order each time
      while (pending_ > 0) std::this_thread::sleep_for(50us);
    }
    view.reset();
    reader.reset();
    writer.stop();
    return writer.failed();
  }

  void post(DbWriter& writer) {
    ++pending_;
    const auto done = [this](const std::string& mark, std::uint64_t number) {
      return [this, mark, number](const Status& status) {
        if (status.ok()) log_.mark(mark, number);
        --pending_;
      };
    };
    const std::uint64_t at = random_.below(4);
    // four sessions at a time; a closed one makes room for the next
    std::uint64_t& session = open_[at];
    const bool begins = session == 0;
    if (begins) session = ++last_session_;
    Given& given = given_[session];
    const std::uint64_t number = session;
    Status posted;
    if (begins) {
      posted = writer.post(
          [number](Connection& c) {
            auto description = describe(idOf(number));
            description.set_profile_json(std::string(200 + number * 37 % 3000, 'x'));
            const auto seq = SessionStore(c).open(description, 1);
            return seq.ok() ? Status() : Status(seq.error());
          },
          done("opened", number));
    } else if (given.chunks > 6 && random_.chance(0.2)) {
      pb::CloseSession request;
      request.set_session_id(bytesOfId(idOf(number)));
      request.set_chunks(given.chunks);
      request.set_samples(given.samples);
      const Digest digest = given.hash.digest();
      request.set_hash(digest.data(), digest.size());
      posted = writer.post(
          [request](Connection& c) {
            const auto closed = SessionStore(c).close(request, 2);
            return closed.ok() && closed->taken() ? Status()
                                                  : Status(Error{ErrorCode::kFailed, "not closed"});
          },
          done("closed", chunkMark(number, given.chunks)));
      session = 0;
    } else {
      const bool again = given.chunks > 0 && random_.chance(0.1);
      const std::uint64_t seq = again ? random_.below(given.chunks) : given.chunks;
      const Bytes bytes = chunkFor(number, seq);
      if (!again) {
        ++given.chunks;
        given.samples += inspectChunk(bytes)->count;
        given.hash.update(bytes);
      }
      posted = writer.post(
          [number, seq, bytes](Connection& c) {
            const auto appended = SessionStore(c).append(idOf(number), seq, bytes);
            return appended.ok() && appended->taken() ? Status()
                                                      : Status(Error{ErrorCode::kFailed, "not taken"});
          },
          done("ack", chunkMark(number, seq)));
    }
    if (!posted.ok()) --pending_;
  }

  Random random_;
  DiskLog& log_;
  const std::filesystem::path path_;
  std::atomic<int> pending_ = 0;
  std::uint64_t open_[4] = {};
  std::uint64_t last_session_ = 0;
  std::map<std::uint64_t, Given> given_;
};

/// The chunks acknowledged before an instant.
struct Acknowledged {
  std::map<std::uint64_t, std::uint64_t> chunks;  // by session: how many
  std::map<std::uint64_t, std::uint64_t> closed;  // number of chunks
};
Acknowledged acknowledgedBefore(const DiskLog& log, std::size_t instant) {
  Acknowledged all;
  for (std::size_t i = 0; i < instant; ++i) {
    const DiskEvent& e = log.events()[i];
    if (e.kind != DiskEvent::Kind::kMark) continue;
    const std::uint64_t session = e.offset / 1'000'000, seq = e.offset % 1'000'000;
    if (e.name == "opened") all.chunks[e.offset];
    if (e.name == "ack") all.chunks[session] = std::max(all.chunks[session], seq + 1);
    if (e.name == "closed") all.closed[session] = seq;
  }
  return all;
}

std::string judgeDatabase(const DiskLog& log, const std::filesystem::path& folder, std::size_t instant) {
  auto opened = Connection::open(folder / "needlelab.db", {.mode = Connection::Mode::kWriter});
  if (!opened) return opened.error().message;
  if (auto done = migrate(*opened); !done) return done.error().message;
  const auto check = checkDatabase(*opened);
  if (!check) return check.error().message;
  if (!check->ok()) return check->faults.front();
  SessionStore store(*opened);
  const Acknowledged all = acknowledgedBefore(log, instant);
  for (const auto& [session, count] : all.chunks) {
    const std::string name = "session " + std::to_string(session);
    const auto next = store.nextSeq(idOf(session));
    if (!next) return name + " was acknowledged: " + next.error().message;
    if (*next < count)
      return name + " has " + std::to_string(*next) + " chunks, " + std::to_string(count) +
             " were acknowledged";
    // chunks beyond the acknowledged ones are also correct
    const auto chunks = store.readChunks(idOf(session), 0, UINT32_MAX, SIZE_MAX);
    if (!chunks) return chunks.error().message;
    if (chunks->size() != *next) return name + " gives another number of chunks than it has";
    for (const StoredChunk& chunk : *chunks)
      if (chunk.bytes != chunkFor(session, chunk.seq))
        return name + ": other bytes in chunk " + std::to_string(chunk.seq);
    const auto info = store.info(idOf(session));
    if (!info) return info.error().message;
    if (const auto closed = all.closed.find(session); closed != all.closed.end()) {
      if (info->state() != pb::SESSION_COMPLETE || info->chunks() != closed->second)
        return name + " is not closed";
      continue;
    }
    if (info->state() != pb::SESSION_OPEN) continue;
    // the station resumes
    auto transaction = Transaction::begin(*opened, Transaction::Kind::kWrite);
    if (!transaction) return transaction.error().message;
    const auto appended = store.append(idOf(session), *next, chunkFor(session, *next));
    if (!appended || appended->kind != Appended::Kind::kStored) return name + " does not continue";
    if (auto done = transaction->commit(); !done) return done.error().message;
  }
  return {};
}

CutCounts databaseCampaign(std::uint64_t seed, int runs, int cuts_each,
                           const std::function<void(Random&)>& before = {}) {
  CutCounts counts;
  for (int i = 0; i < runs; ++i) {
    TestDb db;
    { const Connection closed = std::move(db.writer); }
    DiskLog log;
    Random random(seed + static_cast<std::uint64_t>(i));
    {
      const Watching watching(db.folder.path(), log);
      if (before) before(random);
      Load load(seed + static_cast<std::uint64_t>(i), log, db.path);
      const auto error = load.run(8);
      WatchedDisk::clearFault();
      if (!before && error) throw std::runtime_error(error->message);
    }
    cutLog(
        log, log.begin(), log.events().size(), cuts_each, seed + static_cast<std::uint64_t>(i),
        [&](const std::filesystem::path& folder, std::size_t instant, Random&) {
          return judgeDatabase(log, folder, instant);
        },
        counts);
  }
  return counts;
}

TEST(DatabaseCut, memoryMappingIsOff) {
  TestDb db;
  auto size = db.writer.prepare("PRAGMA mmap_size");
  const auto row = size.step();
  ASSERT_OK(row);
  // with mapped files a write could reach the disk without a visible call
  EXPECT_EQ(*row ? size.integer(0) : 0, 0);
}

TEST(DatabaseCut, theSameSeedMakesTheSameCalls) {
  std::vector<std::size_t> sizes;
  for (int i = 0; i < 2; ++i) {
    TestDb db;
    { const Connection closed = std::move(db.writer); }
    DiskLog log;
    const Watching watching(db.folder.path(), log);
    Load load(5, log, db.path);
    ASSERT_FALSE(load.run(6));
    std::size_t calls = 0;
    for (const DiskEvent& e : log.events()) calls += e.kind == DiskEvent::Kind::kMark ? 0 : 1;
    sizes.push_back(calls);
  }
  EXPECT_EQ(sizes[0], sizes[1]);
  EXPECT_GT(sizes[0], 200u);
}

TEST(DatabaseCut, nothingAcknowledgedIsLost) {
  const std::uint64_t seed = seedOr(20261120);
  const CutCounts counts = longForm()     ? databaseCampaign(seed, 100, 40)
                           : plantedRun() ? databaseCampaign(seed, 3, 8)
                                          : databaseCampaign(seed, 6, 12);
  report("database", counts);
  EXPECT_EQ(counts.bad, 0u) << counts.first;
  EXPECT_GE(counts.cuts, 60u);
  EXPECT_GE(5 * (counts.in_commit + counts.in_checkpoint), counts.cuts) << "the cuts are not where it hurts";
  EXPECT_GT(counts.in_commit, 0u);
  EXPECT_GT(counts.in_checkpoint, 0u);
}

TEST(DatabaseCut, aFailedSyncBeforeTheCutLosesNothingAcknowledged) {
  // one sync fails, of the log or of the database, and then the power fails
  const std::uint64_t seed = seedOr(77);
  int failed = 0;
  const auto fails_once = [&failed](Random& random) {
    auto left = std::make_shared<int>(static_cast<int>(5 + random.below(60)));
    WatchedDisk::setFault("/", [left, &failed](DiskCall call, const std::string& path) {
      if (call != DiskCall::kSync || path.find("needlelab.db") == std::string::npos || --*left != 0) return 0;
      ++failed;
      return EIO;
    });
  };
  const CutCounts counts = databaseCampaign(seed, longForm() ? 100 : plantedRun() ? 3 : 6, 8, fails_once);
  report("database after a failed sync", counts);
  EXPECT_EQ(counts.bad, 0u) << counts.first;
  EXPECT_GT(failed, 2);
}

// planted bugs show that the campaign detects them; this test reads the campaign's output

TEST(DatabaseCutPlanted, synchronousNormalIsCaught) {
  const auto run = runPlanted("synchronous-normal", "DatabaseCut.nothingAcknowledgedIsLost");
  EXPECT_TRUE(run.failed) << run.said;
}

TEST(DatabaseCutPlanted, anIgnoredFsyncErrorIsCaught) {
  const auto run =
      runPlanted("fsync-error-ignored", "DatabaseCut.aFailedSyncBeforeTheCutLosesNothingAcknowledged");
  EXPECT_TRUE(run.failed) << run.said;
}

TEST(DatabaseCutPlanted, anAckBeforeTheCommitIsCaught) {
  const auto run = runPlanted("ack-before-commit", "DatabaseCut.nothingAcknowledgedIsLost");
  EXPECT_TRUE(run.failed) << run.said;
}

}  // namespace
}  // namespace needlelab::test
