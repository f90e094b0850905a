#include "client/net/spool/spool_writer.h"

#include <gmock/gmock.h>
#include <sys/resource.h>

#include <csignal>
#include <functional>

#include "common/gesture/chunk.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/client/net/spool/spool_samples.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr std::int64_t kMs = 1'000'000;

// A spool with one session and everything a writer needs. Except for one test the writer has no threads: the
// test runs both passes on a simulated clock, at the times they request.
class SpoolWriterTest : public testing::Test {
 protected:
  SpoolWriterTest() {
    auto spool = Spool::open(folder_.path());
    EXPECT_TRUE(spool.ok());
    spool_ = std::move(*spool);
    session_ = *spool_->create(describeSession(makeUuidV7()));
  }
  SpoolWriter::Callbacks callbacks() {
    return {[this](const SamplePiece& piece) {
              ASSERT_EQ(piece.samples->back().tick, piece.last.tick);
              const std::scoped_lock lock(mutex_);
              pieces_.push_back(piece.samples->size());
              live_samples_ += piece.samples->size();
              EXPECT_EQ(piece.samples_so_far, live_samples_);
            },
            [this] { ++durable_; },
            [this](const std::string& text) {
              const std::scoped_lock lock(mutex_);
              troubles_.push_back(text);
            }};
  }
  void push(std::uint64_t first, std::uint64_t count) {
    for (std::uint64_t k = first; k < first + count; ++k) ASSERT_TRUE(ring_.push(sampleAt(k)));
  }
  std::vector<GestureSample> stored() {
    std::vector<GestureSample> all;
    for (std::uint64_t seq = 0; seq < session_->contents().chunks; ++seq) {
      auto samples = decodeChunk(*session_->readChunk(seq));
      EXPECT_TRUE(samples.ok());
      all.insert(all.end(), samples->begin(), samples->end());
    }
    return all;
  }
  SpoolWriterOptions stepped(std::size_t pending_bytes = SpoolWriterOptions{}.pending_bytes) {
    return {.pending_bytes = pending_bytes, .time = &time_, .threads = false};
  }
  // Runs the passes that are due during the next `ms` of simulated time; those due at its end run too.
  void run(SpoolWriter& writer, std::int64_t ms) {
    const std::int64_t until_ns = time_.nowNs() + ms * kMs;
    while (std::min(next_write_ns_, next_sync_ns_) <= until_ns) {
      time_.advanceTo(std::min(next_write_ns_, next_sync_ns_));
      if (next_write_ns_ <= time_.nowNs()) next_write_ns_ = writer.writePass();
      next_sync_ns_ = writer.syncPass();
    }
    time_.advanceTo(until_ns);
  }
  // Runs until the writer tries again and the disk refuses again, after exactly this time.
  void expectNextTryAfter(SpoolWriter& writer, std::int64_t ms) {
    const std::uint64_t errors = writer.counts().disk_errors;
    run(writer, ms - 1);
    EXPECT_EQ(writer.counts().disk_errors, errors) << "too early";
    run(writer, 1);
    EXPECT_EQ(writer.counts().disk_errors, errors + 1);
  }
  [[nodiscard]] std::uintmax_t tailBytes() const {
    return std::filesystem::file_size(session_->folder() / "tail");
  }
  // what the next program start finds
  void reopen() {
    session_.reset();
    spool_.reset();
    auto spool = Spool::open(folder_.path());
    ASSERT_TRUE(spool.ok());
    spool_ = std::move(*spool);
    session_ = spool_->unfinished().at(0);
  }

  TempFolder folder_;
  std::unique_ptr<Spool> spool_;
  std::shared_ptr<SpoolSession> session_;
  SampleRing ring_;
  std::mutex mutex_;
  std::vector<std::size_t> pieces_;
  std::uint64_t live_samples_ = 0;
  std::vector<std::string> troubles_;
  std::atomic<int> durable_{0};
  FakeTime time_;
  std::int64_t next_write_ns_ = 0, next_sync_ns_ = 0;
};

TEST_F(SpoolWriterTest, threadsPutEverySampleIntoAChunkAndAPiece) {
  SpoolWriter writer(ring_, session_, {}, callbacks());
  push(0, 5000);
  push(5000, 2345);
  ASSERT_TRUE(writer.finish(1s).ok());
  const auto samples = stored();
  ASSERT_EQ(samples.size(), 7345u);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    ASSERT_EQ(samples[i].tick, i);
    ASSERT_TRUE(isSampleOfItsTick(samples[i]));
  }
  const SpoolContents contents = session_->contents();
  EXPECT_EQ(contents.chunks, 8u);
  EXPECT_TRUE(contents.ended);
  EXPECT_FALSE(contents.interrupted);
  const SpoolWriterCounts counts = writer.counts();
  EXPECT_EQ(counts.samples, 7345u);
  EXPECT_EQ(counts.samples_lost, 0u);
  EXPECT_EQ(counts.chunks, 8u);
  EXPECT_EQ(counts.chunk_bytes, contents.bytes);
  EXPECT_EQ(live_samples_, 7345u);
  EXPECT_LE(*std::max_element(pieces_.begin(), pieces_.end()), 20u);
  EXPECT_GE(durable_, 1);
  EXPECT_TRUE(troubles_.empty());
}

// The writer polls every 4 ms; a sample waits at most 10 ms from the poll that took it.
TEST_F(SpoolWriterTest, aFewSamplesReachTheTailAfter10ms) {
  SpoolWriter writer(ring_, session_, stepped(), callbacks());
  push(0, 7);
  run(writer, 11);
  EXPECT_EQ(tailBytes(), 0u);
  run(writer, 1);
  EXPECT_GT(tailBytes(), 0u);
  EXPECT_TRUE(pieces_.empty());
  run(writer, 7);
  EXPECT_TRUE(pieces_.empty());
  run(writer, 1);
  EXPECT_EQ(pieces_, std::vector<std::size_t>{7}) << "a piece waits 20 ms for more samples";
  ASSERT_TRUE(writer.finish(1s).ok());
  EXPECT_EQ(tailBytes(), 0u);
  EXPECT_EQ(stored().size(), 7u);
}

TEST_F(SpoolWriterTest, aChunkIsSyncedAsSoonAsItIsWritten) {
  SpoolWriter writer(ring_, session_, stepped(), callbacks());
  for (int second = 1; second <= 3; ++second) {
    push(1000 * static_cast<std::uint64_t>(second - 1), 999);
    run(writer, 500);
    EXPECT_EQ(durable_, second - 1);
    EXPECT_EQ(writer.syncPass(), SpoolWriter::kNotDue_ns);
    push(1000 * static_cast<std::uint64_t>(second) - 1, 1);
    run(writer, 4);
    EXPECT_EQ(durable_, second);
    EXPECT_EQ(session_->contents().chunks, static_cast<std::uint64_t>(second));
  }
}

// Stands in for the station's follower: each sample from a chunk's 300th on has a memory, up to `last`.
std::function<Bytes(const GestureSample&, bool)> memoriesTo(std::uint64_t last, std::uint64_t& followed) {
  return [last, &followed](const GestureSample& sample, bool wanted) {
    EXPECT_EQ(sample.tick, followed++);
    const bool has_one = sample.tick % 1000 >= 300 && sample.tick <= last;
    return wanted && has_one ? Bytes{1, static_cast<std::uint8_t>(sample.tick / 1000)} : Bytes();
  };
}

TEST_F(SpoolWriterTest, aChunkCarriesItsFirstAvailableCutMemory) {
  SpoolWriter::Callbacks with_memories = callbacks();
  std::uint64_t followed = 0;
  with_memories.cut_memory = memoriesTo(2300, followed);
  SpoolWriter writer(ring_, session_, stepped(), with_memories);
  push(0, 4500);
  ASSERT_TRUE(writer.finish(1s).ok());
  EXPECT_EQ(followed, 4500u);
  ASSERT_EQ(session_->contents().chunks, 5u);
  for (std::uint64_t seq = 0; seq < 5; ++seq) {
    const auto samples = samplesFrom(1000 * seq, seq < 4 ? 1000 : 500);
    const Bytes memory = seq < 3 ? Bytes{1, static_cast<std::uint8_t>(seq)} : Bytes();
    EXPECT_EQ(*session_->readChunk(seq), encodeChunk(Resolution::standard(), samples, memory)) << seq;
  }
}

TEST_F(SpoolWriterTest, theChunkThatIsMadeOfATailHasItsMemory) {
  {
    SpoolWriter::Callbacks with_memories = callbacks();
    std::uint64_t followed = 0;
    with_memories.cut_memory = memoriesTo(1999, followed);
    SpoolWriter writer(ring_, session_, stepped(), with_memories);
    push(0, 1290);
    run(writer, 20);
    push(1290, 200);
    run(writer, 20);
  }  // the program dies
  reopen();
  ASSERT_EQ(session_->contents().chunks, 2u);
  EXPECT_EQ(stored().size(), 1490u);
  EXPECT_EQ(cutMemoryOf(*session_->readChunk(1)), (Bytes{1, 1}));
}

/// A path at each chunk's first sample, and at every 300th one.
Bytes pathAt(std::uint64_t tick, bool first) {
  if (!first && tick % 300 != 0) return {};
  return {first ? std::uint8_t{1} : std::uint8_t{0}, static_cast<std::uint8_t>(tick / 100)};
}

TEST_F(SpoolWriterTest, aChunkCarriesThePathsOfItsSamplesInOrder) {
  SpoolWriter::Callbacks with_paths = callbacks();
  std::uint64_t tick = 0;
  with_paths.paths = [&](bool first) { return pathAt(tick++, first); };
  SpoolWriter writer(ring_, session_, stepped(), with_paths);
  push(0, 2100);
  ASSERT_TRUE(writer.finish(1s).ok());
  const Bytes expected[] = {{1, 0, 0, 3, 0, 6, 0, 9}, {1, 10, 0, 12, 0, 15, 0, 18}, {1, 20}};
  ASSERT_EQ(session_->contents().chunks, 3u);
  for (std::uint64_t seq = 0; seq < 3; ++seq)
    EXPECT_EQ(pathListOf(*session_->readChunk(seq)), expected[seq]) << seq;
}

TEST_F(SpoolWriterTest, aChunkMadeOfTheTailCarriesThePathsOfItsPieces) {
  {
    SpoolWriter::Callbacks with_paths = callbacks();
    std::uint64_t tick = 0;
    with_paths.paths = [&](bool first) { return pathAt(tick++, first); };
    SpoolWriter writer(ring_, session_, stepped(), with_paths);
    push(0, 1290);
    run(writer, 20);
    push(1290, 400);
    run(writer, 20);
  }  // the program dies
  reopen();
  ASSERT_EQ(session_->contents().chunks, 2u);
  EXPECT_EQ(pathListOf(*session_->readChunk(1)), (Bytes{1, 10, 0, 12, 0, 15}));
}

TEST_F(SpoolWriterTest, pathsBeyondAChunksRoomAreLeftOut) {
  SpoolWriter::Callbacks with_paths = callbacks();
  with_paths.paths = [](bool) { return Bytes(1000, 7); };
  SpoolWriter writer(ring_, session_, stepped(), with_paths);
  push(0, 1000);
  ASSERT_TRUE(writer.finish(1s).ok());
  EXPECT_EQ(pathListOf(*session_->readChunk(0)), Bytes(32'000, 7));
}

TEST_F(SpoolWriterTest, fromWhatTheRingDroppedOnThereIsNoMemory) {
  SpoolWriter::Callbacks with_memories = callbacks();
  with_memories.cut_memory = [](const GestureSample&, bool wanted) { return wanted ? Bytes{1} : Bytes(); };
  with_memories.paths = [](bool first) { return first ? Bytes{2} : Bytes(); };
  SpoolWriter writer(ring_, session_, stepped(), with_memories);
  push(0, 2000);
  run(writer, 20);
  std::uint64_t tick = 2000;
  while (ring_.dropped() < 5) ring_.push(sampleAt(tick++));
  ASSERT_FALSE(writer.finish(5s).ok());
  ASSERT_GT(session_->contents().chunks, 10u);
  for (std::uint64_t seq = 0; seq < session_->contents().chunks; ++seq) {
    const auto chunk = session_->readChunk(seq);
    EXPECT_EQ(cutMemoryOf(*chunk).empty(), seq >= 2) << seq;
    EXPECT_EQ(pathListOf(*chunk).empty(), seq >= 2) << seq;
  }
}

TEST_F(SpoolWriterTest, aSessionWithoutSamplesEndsEmpty) {
  SpoolWriter writer(ring_, session_, {}, callbacks());
  ASSERT_TRUE(writer.finish(1s).ok());
  EXPECT_EQ(session_->contents().chunks, 0u);
  EXPECT_TRUE(session_->contents().ended);
}

// A file size limit simulates a full disk: the kernel refuses with EFBIG.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &before_);
    rlimit now = before_;
    now.rlim_cur = bytes;
    ::setrlimit(RLIMIT_FSIZE, &now);
  }
  void makeRoom() { ::setrlimit(RLIMIT_FSIZE, &before_); }
  ~FullDisk() { makeRoom(); }

 private:
  rlimit before_{};
};

TEST_F(SpoolWriterTest, aFullDiskIsRetriedEveryHalfSecondWithoutLoss) {
  SpoolWriter writer(ring_, session_, stepped(), callbacks());
  push(0, 2000);
  run(writer, 0);
  ASSERT_EQ(session_->contents().chunks, 2u);
  FullDisk disk(std::filesystem::file_size(session_->folder() / "chunks"));
  push(2000, 4567);
  run(writer, 4);
  EXPECT_EQ(writer.counts().samples, 6567u);
  EXPECT_EQ(writer.counts().samples_waiting, 4000u);
  EXPECT_FALSE(writer.counts().disk_error.empty());
  EXPECT_GT(writer.counts().disk_errors, 0u);
  for (int tries = 0; tries < 4; ++tries) expectNextTryAfter(writer, 500);
  disk.makeRoom();
  run(writer, 499);
  EXPECT_EQ(session_->contents().chunks, 2u);
  run(writer, 1);
  EXPECT_EQ(session_->contents().chunks, 6u);
  EXPECT_EQ(writer.counts().samples_waiting, 0u);
  EXPECT_TRUE(writer.counts().disk_error.empty());
  ASSERT_TRUE(writer.finish(5s).ok());
  EXPECT_EQ(writer.counts().samples_lost, 0u);
  const auto samples = stored();
  ASSERT_EQ(samples.size(), 6567u);
  for (std::size_t i = 0; i < samples.size(); ++i) ASSERT_EQ(samples[i].tick, i);
  ASSERT_EQ(troubles_.size(), 2u) << "said, not repeated";
  EXPECT_THAT(troubles_[0], HasSubstr("the lesson continues"));
  EXPECT_THAT(troubles_[1], HasSubstr("takes samples again"));
}

TEST_F(SpoolWriterTest, aDiskThatStaysFullEndsWithTheCountedLoss) {
  SpoolWriter writer(ring_, session_, stepped(30'000), callbacks());
  FullDisk disk(0);
  push(0, 16'000);
  run(writer, 4);
  ASSERT_EQ(writer.counts().samples, 16'000u);
  const std::int64_t began_ns = time_.nowNs();
  const std::uint64_t errors = writer.counts().disk_errors;
  const Status status = writer.finish(200ms);
  EXPECT_EQ(time_.nowNs() - began_ns, 200 * kMs) << "the whole patience, and no more";
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kUnavailable);
  disk.makeRoom();
  const SpoolWriterCounts counts = writer.counts();
  EXPECT_GE(counts.disk_errors, errors + 2) << "a try every 100 ms";
  EXPECT_EQ(counts.samples, 16'000u);
  EXPECT_EQ(counts.samples_lost, 16'000u) << "none of it is on the disk";
  EXPECT_EQ(counts.chunks, 0u);
  EXPECT_EQ(counts.chunk_bytes, 0u);
  EXPECT_EQ(session_->contents().chunks, 0u);
  EXPECT_EQ(session_->contents().loss, (SpoolLoss{16'000, 0}));
  EXPECT_THAT(troubles_, testing::Contains(HasSubstr("LOST")));
  EXPECT_EQ(live_samples_, 16'000u) << "who watches live sees them nevertheless";
}

TEST_F(SpoolWriterTest, aLossInTheMiddleIsCountedInTheSession) {
  SpoolWriter writer(ring_, session_, stepped(10'000), callbacks());
  push(0, 1000);
  run(writer, 4);
  ASSERT_EQ(session_->contents().chunks, 1u);
  {
    FullDisk disk(std::filesystem::file_size(session_->folder() / "chunks"));
    push(1000, 16'000);
    run(writer, 4);
    ASSERT_EQ(writer.counts().samples, 17'000u);
    EXPECT_THAT(writer.trouble(), HasSubstr("wait in memory"));
    EXPECT_THAT(writer.trouble(), HasSubstr("are lost"));
    // Each loss is recorded on the disk. This takes longer than the pause before chunks are tried again: a
    // successful write of 42 bytes to an existing file does not mean that samples fit.
    for (std::uint64_t tick = 17'000; tick < 17'120; ++tick) {
      push(tick, 1);
      run(writer, 10);
    }
    EXPECT_THAT(writer.trouble(), HasSubstr("wait in memory"));
    EXPECT_THAT(troubles_, testing::Not(testing::Contains(HasSubstr("takes samples again"))));
  }
  // There is space again: the waiting samples and the new ones are written.
  run(writer, 500);
  EXPECT_EQ(writer.counts().samples_waiting, 0u);
  push(17'120, 2880);
  run(writer, 4);
  ASSERT_EQ(writer.counts().samples, 20'000u);
  const Status status = writer.finish(5s);
  ASSERT_FALSE(status.ok()) << "a loss is not a success";
  const SpoolLoss loss = session_->contents().loss;
  EXPECT_THAT(status.error().message, HasSubstr(std::to_string(loss.samples) + " samples are lost"));
  EXPECT_TRUE(session_->contents().ended);
  const auto samples = stored();
  EXPECT_EQ(samples.size() + loss.samples, 20'000u);
  // one gap, where the session says
  std::uint64_t gaps = 0;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    ASSERT_TRUE(isSampleOfItsTick(samples[i]));
    if (samples[i].tick == samples[i - 1].tick + 1) continue;
    ++gaps;
    EXPECT_EQ(samples[i - 1].tick + 1, loss.from_tick);
    EXPECT_EQ(samples[i].tick - loss.from_tick, loss.samples);
  }
  EXPECT_EQ(gaps, 1u);
}

TEST_F(SpoolWriterTest, samplesOfARefusedChunkInTheTailAreNotLost) {
  {
    SpoolWriter writer(ring_, session_, stepped(), callbacks());
    push(0, 1300);
    run(writer, 12);  // into the tail
    ASSERT_EQ(session_->contents().chunks, 1u);
    FullDisk disk(1);  // no file can grow by a byte
    push(1300, 2700);
    run(writer, 4);
    ASSERT_EQ(writer.counts().samples, 4000u);
    ASSERT_FALSE(writer.finish(100ms).ok());
    EXPECT_EQ(writer.counts().samples_lost, 2700u);
    EXPECT_EQ(session_->contents().loss, (SpoolLoss{2700, 1300}));
    EXPECT_FALSE(session_->contents().ended);
    disk.makeRoom();
    ASSERT_TRUE(
        session_->setLoss(session_->contents().loss).ok());  // a real full disk accepts these in place
  }
  reopen();
  const auto samples = stored();
  ASSERT_EQ(samples.size(), 1300u);
  EXPECT_EQ(session_->contents().loss, (SpoolLoss{2700, 1300}));
}

TEST_F(SpoolWriterTest, aSessionWhoseLastChunkHasNoRoomIsNotEndedAndLosesNothing) {
  {
    SpoolWriter writer(ring_, session_, stepped(), callbacks());
    push(0, 1300);
    run(writer, 12);  // 300 of them in the tail alone
    FullDisk disk(1);
    const Status ended = writer.finish(100ms);
    ASSERT_FALSE(ended.ok());
    EXPECT_THAT(ended.error().message, HasSubstr("could not be ended"));
    EXPECT_EQ(writer.counts().samples_lost, 0u);
    EXPECT_FALSE(session_->contents().ended);
  }
  reopen();
  EXPECT_EQ(stored().size(), 1300u);
}

TEST_F(SpoolWriterTest, aRingThatOverflowsCountsAsLossOfTheSession) {
  SpoolWriter writer(ring_, session_, stepped(), callbacks());
  // full before the writer drains it
  std::uint64_t tick = 0;
  while (ring_.dropped() < 5) ring_.push(sampleAt(tick++));
  ASSERT_FALSE(writer.finish(5s).ok());
  EXPECT_EQ(session_->contents().loss, (SpoolLoss{5, kSampleRingCapacity}));
  EXPECT_EQ(stored().size(), kSampleRingCapacity);
}

TEST_F(SpoolWriterTest, noSampleWaitsLongerThan14msForTheTail) {
  // The rhythm of the haptic loop, with breaks. A copy of the spool at any time is the state after a crash. A
  // sample waits up to 4 ms for the writer's poll and then up to 10 ms, or until ten have come.
  SpoolWriter writer(ring_, session_, stepped(), callbacks());
  std::vector<std::int64_t> pushed_ns;
  std::int64_t worst_ns = 0;
  const auto saved = [&] {
    const TempFolder copy;
    std::filesystem::copy(session_->folder(), copy.path() / session_->idText(),
                          std::filesystem::copy_options::recursive);
    auto spool = Spool::open(copy.path());
    return (*spool)->unfinished().at(0)->contents().samples;
  };
  for (int round = 0; round < 5; ++round) {
    for (int ms = 0; ms < 31 + 7 * (round % 5); ++ms) {
      if (ms < 20 + 7 * (round % 3)) {
        ring_.push(sampleAt(pushed_ns.size()));
        pushed_ns.push_back(time_.nowNs());
      }
      run(writer, 1);
      if ((next_write_ns_ - time_.nowNs()) / kMs != 1) continue;  // just before the poll: the worst moment
      const std::uint64_t there = saved();
      if (there < pushed_ns.size()) worst_ns = std::max(worst_ns, time_.nowNs() - pushed_ns[there]);
    }
  }
  EXPECT_LE(worst_ns, 15 * kMs);
  EXPECT_GE(worst_ns, 9 * kMs) << "nothing waits: the test looks at the wrong time";
  ASSERT_TRUE(writer.finish(5s).ok());
}

TEST_F(SpoolWriterTest, aRefusedTailIsRetriedEvery20msAndCompletedLater) {
  {
    SpoolWriter writer(ring_, session_, stepped(), callbacks());
    FullDisk disk(10);
    push(0, 500);  // less than a chunk: only pieces are refused
    run(writer, 0);
    EXPECT_EQ(writer.counts().disk_errors, 1u);
    for (int tries = 0; tries < 5; ++tries) expectNextTryAfter(writer, 20);
    disk.makeRoom();
    push(500, 40);
    run(writer, 20);
    EXPECT_GT(tailBytes(), 0u);
    // The writer is destroyed without `finish`, as if the program had crashed.
  }
  reopen();
  const auto samples = stored();
  ASSERT_EQ(samples.size(), 540u);
  for (std::size_t i = 0; i < samples.size(); ++i) ASSERT_EQ(samples[i].tick, i);
}

}  // namespace
}  // namespace needlelab::test
