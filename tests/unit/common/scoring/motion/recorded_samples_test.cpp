#include "common/scoring/motion/recorded_samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <memory>

#include "common/scoring/measures/syringe_events.h"
#include "common/scoring/motion/track.h"
#include "tests/unit/common/scoring/continuous_gesture.h"

namespace needlelab {
namespace {

constexpr double kRate_hz = 1000;

/// A recording in blocks that counts how often one is decoded.
struct InBlocks {
  InBlocks(std::vector<GestureSample> all, std::size_t block)
      : samples(std::move(all)), block_samples(block) {}

  [[nodiscard]] std::size_t blocks() const { return (samples.size() + block_samples - 1) / block_samples; }
  RecordedSamples::Read read() {
    return [this](std::size_t number) -> Result<std::vector<GestureSample>> {
      ++decoded;
      if (decoded > fails_after) return Error{ErrorCode::kFailed, "the disk fails"};
      const auto begin = samples.begin() + static_cast<std::ptrdiff_t>(number * block_samples);
      const auto count = std::min(block_samples, samples.size() - number * block_samples);
      return std::vector<GestureSample>(begin, begin + static_cast<std::ptrdiff_t>(count));
    };
  }
  RecordedSamples open(std::size_t max_held = RecordedSamples::kMaxHeld) {
    return std::move(RecordedSamples::inBlocks(blocks(), read(), max_held)).value();
  }

  std::vector<GestureSample> samples;
  std::size_t block_samples;
  std::size_t decoded = 0;
  std::size_t fails_after = SIZE_MAX;
};

/// Names and bits of all rows.
std::vector<std::pair<std::string, std::uint64_t>> bitsOf(const std::vector<Measure>& score) {
  std::vector<std::pair<std::string, std::uint64_t>> bits;
  for (const Measure& row : score) bits.emplace_back(row.name, std::bit_cast<std::uint64_t>(row.value));
  return bits;
}

/// A gesture with two long gaps and with samples that do not count.
std::vector<GestureSample> roughGesture(std::uint64_t seed) {
  std::vector<GestureSample> samples = ContinuousGesture(seed).samples(kRate_hz);
  samples.erase(samples.begin() + 3000, samples.begin() + 3150);
  samples.erase(samples.begin() + 6000, samples.begin() + 6400);
  samples[1000].p_WT_m[0] = 1e9;
  samples[2000].tick = samples[1500].tick;
  for (std::size_t i = 4000; i < 4100; ++i) samples[i].force_W_N[1] = 1e9;  // whole blocks, for some sizes
  return samples;
}

TEST(RecordedSamples, aScoreByBlocksHasTheBitsOfTheScoreInMemory) {
  const pb::Exercise exercise = plannedExercise();
  for (const std::uint64_t seed : {3u, 7u}) {
    const auto samples = roughGesture(seed);
    const pb::Profile profile = ContinuousGesture(seed).profile();
    const std::vector<TipPath> references{tipPathOf(ContinuousGesture(5).samples(kRate_hz), kRate_hz, {})};
    const auto expected = scoreGesture(samples, kRate_hz, profile, {}, &exercise, references);
    const auto events = eventsJson(syringeEvents(samples, kRate_hz, profile, {}));
    const TipPath path = tipPathOf(samples, kRate_hz, {});
    ASSERT_FALSE(expected.empty());
    for (const std::size_t block : {1u, 7u, 50u, 1000u, 65'536u}) {
      InBlocks source(samples, block);
      const RecordedSamples blocks = source.open(4 * block);
      EXPECT_EQ(bitsOf(scoreGesture(blocks, kRate_hz, profile, {}, &exercise, references)), bitsOf(expected))
          << block;
      EXPECT_EQ(eventsJson(syringeEvents(blocks, kRate_hz, profile, {})), events) << block;
      const TipPath again = tipPathOf(blocks, kRate_hz, {});
      ASSERT_EQ(again.size(), path.size());
      EXPECT_TRUE(std::equal(path.begin(), path.end(), again.begin(),
                             [](Vec3 a, Vec3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }));
      EXPECT_TRUE(blocks.fault().ok());
    }
  }
}

TEST(GestureScore, steppedScoringIsBitIdenticalAndReadsABoundedAmount) {
  const pb::Exercise exercise = plannedExercise();
  const auto samples = roughGesture(3);
  const pb::Profile profile = ContinuousGesture(3).profile();
  const std::vector<TipPath> references{tipPathOf(ContinuousGesture(5).samples(kRate_hz), kRate_hz, {})};
  const auto expected = scoreGesture(samples, kRate_hz, profile, {}, &exercise, references);
  const auto events = eventsJson(syringeEvents(samples, kRate_hz, profile, {}));
  ASSERT_FALSE(expected.empty());
  constexpr std::size_t kBlock = 50;
  for (const std::uint64_t each : {1u, 137u, 5'000u, 1'000'000'000u}) {
    SCOPED_TRACE(each);
    InBlocks source(samples, kBlock);
    const RecordedSamples blocks = source.open(4 * kBlock);
    GestureScore score(blocks, kRate_hz, profile, {}, &exercise, references);
    std::size_t steps = 0, most = 0;
    for (bool done = false; !done; ++steps) {
      ASSERT_LE(steps, 100 * samples.size()) << "it gets on";
      const std::size_t before = source.decoded;
      StepWork work(each);
      done = score.step(work);
      most = std::max(most, source.decoded - before);
    }
    EXPECT_EQ(bitsOf(score.measures()), bitsOf(expected));
    EXPECT_EQ(eventsJson(score.events()), events);
    if (each > 100 * samples.size()) {
      EXPECT_EQ(steps, 1u);
      continue;
    }
    // in addition to the samples in order: the ends of a run, of an insertion, of strokes
    EXPECT_LE(most, each / kBlock + 40);
    EXPECT_GE(steps, 4 * samples.size() / each) << "it is read so often";
  }
}

TEST(GestureScore, ofALongRecordingEachBlockIsDecodedHalfADozenTimes) {
  InBlocks source(ContinuousGesture(3).samples(kRate_hz), 1000);
  const RecordedSamples blocks = source.open(4'000);
  (void)scoreGesture(blocks, kRate_hz, ContinuousGesture(3).profile(), {});
  // opening, its motion's cost, runs, motion, measures; parts of it for the longest insertion and the strokes
  EXPECT_LE(source.decoded, 7 * source.blocks());
}

TEST(GestureScore, withAFaultInTheSamplesItEndsWithoutMeasures) {
  InBlocks source(ContinuousGesture(3).samples(kRate_hz), 1000);
  const RecordedSamples blocks = source.open(4'000);
  const pb::Profile profile = ContinuousGesture(3).profile();
  GestureScore score(blocks, kRate_hz, profile, {});
  StepWork some(1'000);
  ASSERT_FALSE(score.step(some));
  source.fails_after = source.decoded;
  StepWork all = StepWork::all();
  EXPECT_TRUE(score.step(all));
  EXPECT_FALSE(blocks.fault().ok());
  EXPECT_TRUE(score.measures().empty());
}

TEST(RecordedSamples, atMostSoManyAreHeldHoweverLongTheRecordingIs) {
  const auto samples = ContinuousGesture(3).samples(kRate_hz);
  ASSERT_GT(samples.size(), 10'000u);
  for (const std::size_t most : {4'000u, 6'000u}) {
    InBlocks source(samples, 1000);
    const RecordedSamples blocks = source.open(most);
    (void)scoreGesture(blocks, kRate_hz, ContinuousGesture(3).profile(), {});
    EXPECT_LE(blocks.mostHeld(), most);
    EXPECT_GT(source.decoded, 2 * source.blocks()) << "it is read several times";
  }
}

TEST(RecordedSamples, aShortRecordingIsDecodedOnce) {
  InBlocks source(ContinuousGesture(3).samples(kRate_hz), 1000);
  const RecordedSamples blocks = source.open();
  (void)scoreGesture(blocks, kRate_hz, ContinuousGesture(3).profile(), {});
  EXPECT_EQ(source.decoded, source.blocks());
}

TEST(RecordedSamples, areThoseThatCleanedKeeps) {
  const auto samples = roughGesture(3);
  std::vector<GestureSample> storage;
  const auto kept = cleaned(samples, storage);
  InBlocks source(samples, 50);
  const RecordedSamples blocks = source.open(400);
  ASSERT_EQ(blocks.size(), kept.size());
  EXPECT_EQ(blocks.front().tick, kept.front().tick);
  EXPECT_EQ(blocks.back().tick, kept.back().tick);
  for (std::size_t i = 0; i < kept.size(); ++i) ASSERT_EQ(blocks[i].tick, kept[i].tick) << i;
  for (std::size_t i = kept.size(); i-- > 0;) ASSERT_EQ(blocks[i].tick, kept[i].tick) << i;
}

TEST(RecordedSamples, theBlockThatWasUnusedLongestGivesWay) {
  InBlocks source(ContinuousGesture(3).samples(kRate_hz), 100);
  const RecordedSamples blocks = source.open(500);  // five blocks
  for (const std::size_t block : {0u, 1u, 2u, 3u, 4u, 0u, 5u}) (void)blocks[block * 100];
  const std::size_t decoded = source.decoded;
  (void)blocks[0];
  EXPECT_EQ(source.decoded, decoded) << "0 was used again, so 1 gave way";
  (void)blocks[100];
  EXPECT_EQ(source.decoded, decoded + 1);
}

TEST(RecordedSamples, aReferenceOutlivesThreeOtherBlocks) {
  InBlocks source(ContinuousGesture(3).samples(kRate_hz), 100);
  const RecordedSamples blocks = source.open(0);
  const GestureSample& first = blocks[0];
  const std::uint64_t tick = first.tick;
  (void)blocks[100];
  (void)blocks[200];
  (void)blocks[300];
  EXPECT_EQ(first.tick, tick);
  EXPECT_EQ(blocks.mostHeld(), 400u);
}

TEST(RecordedSamples, anUnreadableBlockIsAFaultAndEndsTheScore) {
  InBlocks source(ContinuousGesture(3).samples(kRate_hz), 1000);
  source.fails_after = source.blocks() + 3;
  const RecordedSamples blocks = source.open(4'000);
  (void)scoreGesture(blocks, kRate_hz, ContinuousGesture(3).profile(), {});
  ASSERT_FALSE(blocks.fault().ok());
  EXPECT_EQ(blocks.fault().error().message, "the disk fails");
  EXPECT_EQ(source.decoded, source.fails_after + 1) << "a failing disk is not asked again";
}

TEST(RecordedSamples, mayBeAddedBlockByBlockAndAreReadInBetween) {
  const auto samples = roughGesture(3);
  InBlocks source(samples, 50);
  RecordedSamples all = source.open(400);
  RecordedSamples growing = RecordedSamples::ofBlocks(source.read(), 400);
  EXPECT_TRUE(growing.empty());
  std::size_t read = 0;
  for (std::size_t block = 0; block < source.blocks(); ++block) {
    const auto added = growing.addBlock();
    ASSERT_TRUE(added.ok());
    read += *added;
    for (std::size_t i : {std::size_t{0}, growing.size() / 2, growing.size() - 1})
      ASSERT_EQ(growing[i].tick, all[i].tick) << block;
  }
  EXPECT_EQ(read, samples.size()) << "usable or not";
  EXPECT_EQ(growing.size(), all.size());
  EXPECT_EQ(growing.back().tick, all.back().tick);
}

TEST(RecordedSamples, aBlockThatCannotBeReadAtFirstIsAnError) {
  InBlocks source(ContinuousGesture(3).samples(kRate_hz), 1000);
  source.fails_after = 2;
  EXPECT_FALSE(RecordedSamples::inBlocks(source.blocks(), source.read()).ok());
}

TEST(RecordedSamples, mayBeEmpty) {
  EXPECT_TRUE(RecordedSamples(std::span<const GestureSample>()).empty());
  InBlocks source({}, 10);
  EXPECT_TRUE(source.open().empty());
}

}  // namespace
}  // namespace needlelab
