#include "client/net/spool_writer.h"

#include <gmock/gmock.h>
#include <sys/resource.h>

#include <unistd.h>

#include <csignal>

#include "common/base/clock.h"
#include "common/gesture/chunk.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/net/spool_samples.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

// A spool with one session and everything that a writer needs.
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
  template <typename Condition>
  bool eventually(Condition condition) {
    for (int i = 0; i < 500; ++i) {
      if (condition()) return true;
      std::this_thread::sleep_for(10ms);
    }
    return false;
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
};

TEST_F(SpoolWriterTest, everySampleBecomesPartOfAChunkAndOfAPiece) {
  SpoolWriter writer(ring_, session_, {}, callbacks());
  push(0, 5000);
  std::this_thread::sleep_for(20ms);
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

TEST_F(SpoolWriterTest, aFewSamplesReachTheTailWithoutWaitingForTheirPiece) {
  SpoolWriter writer(ring_, session_, {}, callbacks());
  push(0, 7);
  const auto tail = session_->folder() / "tail";
  EXPECT_TRUE(eventually([&] { return std::filesystem::file_size(tail) > 0; }));
  ASSERT_TRUE(writer.finish(1s).ok());
  EXPECT_EQ(std::filesystem::file_size(tail), 0u);
  EXPECT_EQ(stored().size(), 7u);
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

TEST_F(SpoolWriterTest, aFullDiskIsSaidAndNothingIsLostWhenItTakesAgain) {
  SpoolWriter writer(ring_, session_, {}, callbacks());
  push(0, 2000);
  ASSERT_TRUE(eventually([&] { return session_->contents().chunks == 2; }));
  FullDisk disk(std::filesystem::file_size(session_->folder() / "chunks"));
  push(2000, 4567);
  ASSERT_TRUE(eventually([&] { return writer.counts().disk_errors > 0; }));
  ASSERT_TRUE(eventually([&] { return writer.counts().samples == 6567; }));
  EXPECT_FALSE(writer.counts().disk_error.empty());
  disk.makeRoom();
  ASSERT_TRUE(writer.finish(5s).ok());
  EXPECT_EQ(writer.counts().samples_lost, 0u);
  const auto samples = stored();
  ASSERT_EQ(samples.size(), 6567u);
  for (std::size_t i = 0; i < samples.size(); ++i) ASSERT_EQ(samples[i].tick, i);
  ASSERT_FALSE(troubles_.empty());
  EXPECT_THAT(troubles_.front(), HasSubstr("the lesson goes on"));
  EXPECT_LE(troubles_.size(), 4u) << "said, not repeated";
}

TEST_F(SpoolWriterTest, aDiskThatStaysFullEndsInAnErrorThatCountsTheLoss) {
  SpoolWriterOptions options;
  options.pending_bytes = 30'000;
  SpoolWriter writer(ring_, session_, options, callbacks());
  FullDisk disk(0);
  push(0, 16'000);
  ASSERT_TRUE(eventually([&] { return writer.counts().samples == 16'000; }));
  const Status status = writer.finish(200ms);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kUnavailable);
  disk.makeRoom();
  const SpoolWriterCounts counts = writer.counts();
  EXPECT_EQ(counts.samples, 16'000u);
  EXPECT_EQ(counts.samples_lost, 16'000u) << "none of it is on the disk";
  EXPECT_EQ(counts.chunks, 0u);
  EXPECT_EQ(counts.chunk_bytes, 0u);
  EXPECT_EQ(session_->contents().chunks, 0u);
  EXPECT_EQ(session_->contents().loss, (SpoolLoss{16'000, 0}));
  EXPECT_THAT(troubles_, testing::Contains(HasSubstr("LOST")));
  EXPECT_EQ(live_samples_, 16'000u) << "who watches live sees them nevertheless";
}

TEST_F(SpoolWriterTest, whatWasLostInTheMiddleIsCountedAndTheSessionSaysSo) {
  SpoolWriterOptions options;
  options.pending_bytes = 10'000;
  SpoolWriter writer(ring_, session_, options, callbacks());
  push(0, 1000);
  ASSERT_TRUE(eventually([&] { return session_->contents().chunks == 1; }));
  {
    FullDisk disk(std::filesystem::file_size(session_->folder() / "chunks"));
    push(1000, 16'000);
    ASSERT_TRUE(eventually([&] { return writer.counts().samples == 17'000; }));
    EXPECT_THAT(writer.trouble(), HasSubstr("wait in memory"));
    EXPECT_TRUE(eventually([&] { return writer.trouble().find("are lost") != std::string::npos; }));
    // Each loss is recorded on the disk. This takes longer than the pause before chunks are tried again: a
    // successful write of 42 bytes to an existing file does not mean that samples fit.
    for (std::uint64_t tick = 17'000; tick < 17'120; ++tick) {
      push(tick, 1);
      std::this_thread::sleep_for(10ms);
    }
    EXPECT_THAT(writer.trouble(), HasSubstr("wait in memory"));
    const std::scoped_lock lock(mutex_);
    EXPECT_THAT(troubles_, testing::Not(testing::Contains(HasSubstr("takes samples again"))));
  }
  // There is space again: the waiting samples and the new ones are written.
  ASSERT_TRUE(eventually([&] { return writer.counts().samples_waiting == 0; }));
  push(17'120, 2880);
  ASSERT_TRUE(eventually([&] { return writer.counts().samples == 20'000; }));
  const Status status = writer.finish(5s);
  ASSERT_FALSE(status.ok()) << "a loss is no success";
  const SpoolLoss loss = session_->contents().loss;
  EXPECT_THAT(status.error().message, HasSubstr(std::to_string(loss.samples) + " samples are lost"));
  EXPECT_TRUE(session_->contents().ended);
  const auto samples = stored();
  EXPECT_EQ(samples.size() + loss.samples, 20'000u);
  // one gap, at the place that the session states
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

TEST_F(SpoolWriterTest, whatTheTailHoldsOfARefusedChunkIsNotLostAndNotCounted) {
  {
    SpoolWriter writer(ring_, session_, {}, callbacks());
    push(0, 1300);
    ASSERT_TRUE(
        eventually([&] { return writer.counts().samples == 1300 && session_->contents().chunks == 1; }));
    std::this_thread::sleep_for(60ms);  // into the tail
    FullDisk disk(1);                   // not one more byte in any file
    push(1300, 2700);
    ASSERT_TRUE(eventually([&] { return writer.counts().samples == 4000; }));
    ASSERT_FALSE(writer.finish(100ms).ok());
    EXPECT_EQ(writer.counts().samples_lost, 2700u);
    EXPECT_EQ(session_->contents().loss, (SpoolLoss{2700, 1300}));
    EXPECT_FALSE(session_->contents().ended);
    disk.makeRoom();
    ASSERT_TRUE(
        session_->setLoss(session_->contents().loss).ok());  // a real full disk accepts these in place
  }
  session_.reset();
  spool_.reset();
  auto spool = Spool::open(folder_.path());
  ASSERT_TRUE(spool.ok());
  session_ = (*spool)->unfinished().at(0);
  const auto samples = stored();
  ASSERT_EQ(samples.size(), 1300u);
  EXPECT_EQ(session_->contents().loss, (SpoolLoss{2700, 1300}));
}

TEST_F(SpoolWriterTest, aRingThatOverflowsCountsAsLossOfTheSession) {
  SampleRing& ring = ring_;
  // full before the writer drains it
  for (std::uint64_t k = 0; k < kSampleRingCapacity; ++k) ASSERT_TRUE(ring.push(sampleAt(k)));
  SpoolWriter writer(ring, session_, {}, callbacks());
  std::uint64_t tick = kSampleRingCapacity;
  while (ring.dropped() == 0) ring.push(sampleAt(tick++));
  ASSERT_FALSE(writer.finish(5s).ok());
  EXPECT_EQ(session_->contents().loss.samples, ring.dropped());
  EXPECT_EQ(stored().size() + ring.dropped(), tick);
}

TEST_F(SpoolWriterTest, noSampleWaitsLongerThan20msForTheTail) {
  // The rhythm of the haptic loop, with breaks. A copy of the spool at any instant is the state after a
  // crash.
  SpoolWriter writer(ring_, session_, {}, callbacks());
  std::vector<std::int64_t> pushed_ns;
  std::int64_t worst_ns = 0;
  for (int round = 0; round < 20; ++round) {
    for (int k = 0; k < 31 + 7 * (round % 5); ++k) {
      ring_.push(sampleAt(pushed_ns.size()));
      pushed_ns.push_back(steadyNowNs());
      std::this_thread::sleep_for(1ms);
    }
    const std::int64_t now_ns = steadyNowNs();
    std::uint64_t saved = 0;
    const TempFolder copy;
    std::filesystem::copy(session_->folder(), copy.path() / session_->idText(),
                          std::filesystem::copy_options::recursive);
    {
      auto spool = Spool::open(copy.path());
      ASSERT_TRUE(spool.ok());
      saved = (*spool)->unfinished().at(0)->contents().samples;
    }
    if (saved < pushed_ns.size()) worst_ns = std::max(worst_ns, now_ns - pushed_ns[saved]);
  }
  ASSERT_TRUE(writer.finish(5s).ok());
  RecordProperty("worst_ms", std::to_string(1e-6 * static_cast<double>(worst_ns)));
  // The copy is made a little after `now`, which only adds data; an ordinary thread on a busy machine may be
  // late.
  EXPECT_LE(worst_ns, 20'000'000 * (::geteuid() == 0 ? 1 : 5));
}

TEST_F(SpoolWriterTest, whatAFullDiskTookMeanwhileIsInTheTailAfterwards) {
  {
    SpoolWriter writer(ring_, session_, {}, callbacks());
    FullDisk disk(10);
    push(0, 500);  // less than a chunk: only pieces are refused
    ASSERT_TRUE(eventually([&] { return writer.counts().disk_errors > 10; }));
    disk.makeRoom();
    push(500, 40);
    ASSERT_TRUE(eventually([&] { return std::filesystem::file_size(session_->folder() / "tail") > 0; }));
    std::this_thread::sleep_for(50ms);
    // The writer is destroyed without `finish`, as if the program had crashed.
  }
  session_.reset();
  spool_.reset();
  auto spool = Spool::open(folder_.path());
  ASSERT_TRUE(spool.ok());
  session_ = (*spool)->unfinished().at(0);
  const auto samples = stored();
  ASSERT_EQ(samples.size(), 540u);
  for (std::size_t i = 0; i < samples.size(); ++i) ASSERT_EQ(samples[i].tick, i);
}

}  // namespace
}  // namespace needlelab::test
