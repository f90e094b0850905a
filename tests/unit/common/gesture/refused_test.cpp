// What a reader refuses, and what it accepts although unusual: chunks written by another program
// (tests/data/gesture/make_refused.py), and modified ones.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>

#include "common/base/bytes.h"
#include "common/gesture/chunk.h"
#include "tests/support/store/chunk_files.h"
#include "tests/unit/common/gesture/gesture_samples.h"

namespace needlelab {
namespace {

using test::anySamples;
using test::smoothGesture;
using test::withGoodCrc;

const std::filesystem::path kFolder = std::filesystem::path(NEEDLELAB_SOURCE_DIR) / "tests/data/gesture";

/// The check must agree with the decoder: a chunk passes exactly when it can be decoded.
void expectSameAnswer(const Bytes& chunk) {
  const auto samples = decodeChunk(chunk);
  const auto checked = checkChunk(chunk);
  ASSERT_EQ(checked.ok(), samples.ok());
  if (!samples.ok()) {
    ASSERT_EQ(checked.error().code, samples.error().code);
    ASSERT_EQ(checked.error().message, samples.error().message);
    return;
  }
  ASSERT_EQ(checked->count, samples->size());
  ASSERT_EQ(checked->first_tick, inspectChunk(chunk)->first_tick);
  ASSERT_EQ(checked->last_tick, samples->back().tick);
}

TEST(Refused, everyKindOfFaultIsRefusedThoughTheCrcIsRight) {
  const auto chunks = test::namedChunks(kFolder / "refused.tsv");
  EXPECT_GE(chunks.size(), 23u);
  for (const auto& [kind, chunk] : chunks) {
    SCOPED_TRACE(kind);
    const auto refused = decodeChunk(chunk);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt) << refused.error().message;
    EXPECT_EQ(refused.error().message.find("does not agree with its bytes"), std::string::npos)
        << "only what is inside is wrong: " << refused.error().message;
    expectSameAnswer(chunk);
    EXPECT_TRUE(sealedSamples(chunk).has_value());
  }
}

TEST(Refused, strangeChunksAreReadAsTheyStand) {
  std::map<std::string, std::vector<GestureSample>> read;
  for (const auto& [kind, chunk] : test::namedChunks(kFolder / "accepted.tsv")) {
    SCOPED_TRACE(kind);
    expectSameAnswer(chunk);
    const auto samples = decodeChunk(chunk);
    ASSERT_TRUE(samples.ok()) << samples.error().message;
    read[kind] = *samples;
  }
  const auto& repeated = read.at("ticks that repeat");
  const auto& backwards = read.at("ticks that go backwards");
  for (std::size_t i = 0; i < 40; ++i) {
    EXPECT_EQ(repeated[i].tick, 100u);
    EXPECT_EQ(backwards[i].tick, 100 - i);
  }
  EXPECT_LT(read.at("a time that goes backwards")[1].time_ns,
            read.at("a time that goes backwards")[0].time_ns);
  EXPECT_TRUE(std::isnan(read.at("a raw wall that is not a number under its presence bit")[5].wall_W_m[0]));
  EXPECT_EQ(read.at("varints longer than they need be")[0].p_WT_m[1], -1e-6);
  EXPECT_EQ(read.at("one sample").size(), 1u);
  EXPECT_EQ(read.at("values of phase and fault without a name")[0].fault, 255);
}

TEST(Refused, theCheckAgreesWithTheDecoderOnChangedChunks) {
  std::mt19937_64 random(21);
  const Bytes chunks[] = {encodeChunk(Resolution::standard(), smoothGesture(100)),
                          encodeChunk(Resolution::lossless(), anySamples(40, 5)),
                          encodeChunk(Resolution::standard(), anySamples(40, 6)),
                          encodeChunk(Resolution::standard(), smoothGesture(1)),
                          encodeChunk(Resolution::standard(), smoothGesture(60), Bytes(80, 1))};
  std::size_t refused = 0;
  for (int round = 0; round < 30'000; ++round) {
    Bytes bytes = chunks[round % 5];
    for (std::uint64_t n = random() % 3; n > 0; --n)
      bytes[6 + random() % (bytes.size() - 6)] = static_cast<std::uint8_t>(random());
    if (random() % 8 == 0) bytes.resize(8 + random() % (bytes.size() - 7));
    bytes = withGoodCrc(bytes);
    expectSameAnswer(bytes);
    if (HasFatalFailure()) return;
    refused += !checkChunk(bytes).ok();
  }
  EXPECT_GT(refused, 3'000u);
  EXPECT_LT(refused, 27'000u);
}

TEST(Refused, onlyAChunkOfOurVersionWithARightCrcIsSealed) {
  const Bytes good = encodeChunk(Resolution::standard(), smoothGesture(70));
  EXPECT_EQ(sealedSamples(good), 70u);
  Bytes newer = good;
  newer[4] = 4;
  EXPECT_FALSE(sealedSamples(withGoodCrc(newer)).has_value());
  Bytes other = good;
  other[0] = 'X';
  EXPECT_FALSE(sealedSamples(withGoodCrc(other)).has_value());
  for (std::size_t size = 0; size < good.size(); ++size)
    ASSERT_FALSE(sealedSamples(ByteView(good).first(size)).has_value()) << size;
}

}  // namespace
}  // namespace needlelab
