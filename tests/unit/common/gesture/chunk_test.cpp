#include "common/gesture/chunk.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "common/base/bytes.h"
#include "tests/unit/common/gesture/gesture_samples.h"

namespace needlelab {
namespace {

using test::anySamples;
using test::sameBits;
using test::smoothGesture;
using test::within;

std::vector<GestureSample> roundTrip(const Resolution& resolution,
                                     const std::vector<GestureSample>& samples) {
  const Bytes chunk = encodeChunk(resolution, samples);
  EXPECT_LE(chunk.size(), kMaxChunkBytes);
  auto back = decodeChunk(chunk);
  EXPECT_TRUE(back.ok()) << (back.ok() ? "" : back.error().message);
  return back.ok() ? *back : std::vector<GestureSample>(samples.size());
}

// Checks that every column is within half a step of the input, and exact where the format guarantees it.
void expectClose(const Resolution& r, const std::vector<GestureSample>& given,
                 const std::vector<GestureSample>& stored) {
  ASSERT_EQ(given.size(), stored.size());
  for (std::size_t i = 0; i < given.size(); ++i) {
    SCOPED_TRACE("sample " + std::to_string(i));
    const GestureSample &a = given[i], &b = stored[i];
    ASSERT_EQ(a.tick, b.tick);
    ASSERT_EQ(a.time_ns, b.time_ns);
    for (int k = 0; k < 3; ++k) {
      ASSERT_TRUE(within(b.p_WT_m[k], a.p_WT_m[k], r.length_m)) << a.p_WT_m[k] << " " << b.p_WT_m[k];
      ASSERT_TRUE(within(b.force_W_N[k], a.force_W_N[k], r.force_N))
          << a.force_W_N[k] << " " << b.force_W_N[k];
      ASSERT_TRUE(within(b.torque_W_Nm[k], a.torque_W_Nm[k], r.torque_Nm));
      ASSERT_TRUE(within(b.wall_W_m[k], a.wall_W_m[k], r.length_m)) << a.wall_W_m[k] << " " << b.wall_W_m[k];
    }
    for (int k = 0; k < 4; ++k) ASSERT_TRUE(within(b.q_WT[k], a.q_WT[k], r.quaternion));
    ASSERT_TRUE(within(b.speed_mps, a.speed_mps, r.speed_mps));
    ASSERT_TRUE(within(b.insertion_m, a.insertion_m, r.length_m));
    ASSERT_TRUE(within(b.lateral_error_m, a.lateral_error_m, r.length_m));
    ASSERT_TRUE(within(b.plunger, a.plunger, r.quaternion));
    const double time_step_ns = std::max(1.0, r.time_s * 1e9);
    ASSERT_TRUE(within(b.device_ns, a.device_ns, time_step_ns == 1 ? 0 : time_step_ns))
        << a.device_ns << " " << b.device_ns;
    ASSERT_TRUE(within(b.engine_ns, a.engine_ns, time_step_ns == 1 ? 0 : time_step_ns));
    ASSERT_EQ(a.flags, b.flags);
    ASSERT_EQ(a.buttons, b.buttons);
    ASSERT_EQ(a.layer, b.layer);
    ASSERT_EQ(a.phase, b.phase);
    ASSERT_EQ(a.fault, b.fault);
  }
}

void expectBitEqual(const std::vector<GestureSample>& given, const std::vector<GestureSample>& stored) {
  ASSERT_EQ(given.size(), stored.size());
  for (std::size_t i = 0; i < given.size(); ++i) {
    SCOPED_TRACE("sample " + std::to_string(i));
    const GestureSample &a = given[i], &b = stored[i];
    for (int k = 0; k < 3; ++k) {
      ASSERT_TRUE(sameBits(a.p_WT_m[k], b.p_WT_m[k]));
      ASSERT_TRUE(sameBits(a.force_W_N[k], b.force_W_N[k]));
      ASSERT_TRUE(sameBits(a.torque_W_Nm[k], b.torque_W_Nm[k]));
      ASSERT_TRUE(sameBits(a.wall_W_m[k], b.wall_W_m[k]));
    }
    for (int k = 0; k < 4; ++k) ASSERT_TRUE(sameBits(a.q_WT[k], b.q_WT[k]));
    ASSERT_TRUE(sameBits(a.speed_mps, b.speed_mps));
    ASSERT_TRUE(sameBits(a.insertion_m, b.insertion_m));
    ASSERT_TRUE(sameBits(a.lateral_error_m, b.lateral_error_m));
    ASSERT_TRUE(sameBits(a.plunger, b.plunger));
    ASSERT_EQ(a.tick, b.tick);
    ASSERT_EQ(a.time_ns, b.time_ns);
    ASSERT_EQ(a.device_ns, b.device_ns);
    ASSERT_EQ(a.engine_ns, b.engine_ns);
    ASSERT_EQ(a.flags, b.flags);
    ASSERT_EQ(a.buttons, b.buttons);
    ASSERT_EQ(a.layer, b.layer);
    ASSERT_EQ(a.phase, b.phase);
    ASSERT_EQ(a.fault, b.fault);
  }
}

TEST(Chunk, smoothGestureComesBackWithinHalfAStep) {
  for (const std::size_t count : {1u, 2u, 3u, 32u, 33u, 34u, 64u, 65u, 1000u, 4097u}) {
    const auto samples = smoothGesture(count);
    expectClose(Resolution::standard(), samples, roundTrip(Resolution::standard(), samples));
  }
}

TEST(Chunk, everyResolutionKeepsItsTolerance) {
  const auto samples = smoothGesture(200);
  for (const Resolution& r :
       {Resolution{1e-9, 0x1p-30, 1e-6, 1e-6, 1e-9, 1e-6}, Resolution{1e-3, 0x1p-7, 0.1, 0.01, 1e-3, 0.01},
        Resolution{1, 1, 1, 1, 1, 1}, Resolution{3.3e-7, 1.7e-5, 7e-4, 1e-12, 1.1e-6, 0}}) {
    expectClose(r, samples, roundTrip(r, samples));
  }
}

TEST(Chunk, resolutionIsReadBackFromTheHeader) {
  const auto samples = smoothGesture(40);
  for (const Resolution& r :
       {Resolution::standard(), Resolution::lossless(), Resolution{1e-7, 0, 1e-3, 1e-4, 1e-6, 1e-4}}) {
    const auto info = inspectChunk(encodeChunk(r, samples));
    ASSERT_TRUE(info.ok());
    EXPECT_EQ(info->resolution, r);
    EXPECT_EQ(info->version, 1);
    EXPECT_EQ(info->count, 40u);
    EXPECT_EQ(info->first_tick, samples.front().tick);
    EXPECT_EQ(info->last_tick, samples.back().tick);
    EXPECT_EQ(info->first_time_ns, samples.front().time_ns);
    EXPECT_EQ(info->lossless_columns, 0u);
  }
}

TEST(Chunk, constantGestureTakesLessThanABytePerSample) {
  std::vector<GestureSample> samples(1000, smoothGesture(700).back());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].tick = 5 + i;
    samples[i].time_ns = static_cast<std::int64_t>(i) * 1'000'000;
  }
  const Bytes chunk = encodeChunk(Resolution::standard(), samples);
  // fixed header, CRC, one row of varints, a mask for each block of 32
  EXPECT_LT(chunk.size(), 44u + 4u + 90u + 4u * 32u);
  expectClose(Resolution::standard(), samples, *decodeChunk(chunk));
}

TEST(Chunk, alternatingAndJumpingValues) {
  auto samples = smoothGesture(300);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].p_WT_m[0] = i % 2 ? 2147.0 : -2147.0;  // almost the whole range of steps
    samples[i].force_W_N[1] = i % 7 == 0 ? 2e6 : 0;
    samples[i].q_WT[3] = i % 2 ? 1 : -1;
    samples[i].flags = i % 3 ? 0xFFFFFFFFu : 0;
    samples[i].buttons = i % 5 ? 0x80000001u : 0;
    samples[i].layer = i % 2 ? std::int8_t{-128} : std::int8_t{127};
    samples[i].phase = i % 2 ? 255 : 0;
    samples[i].fault = static_cast<std::uint8_t>(i);
    samples[i].device_ns =
        i % 2 ? std::numeric_limits<std::int32_t>::max() : std::numeric_limits<std::int32_t>::min();
    samples[i].engine_ns = -static_cast<std::int32_t>(i) * 1'000'000;
  }
  expectClose(Resolution::standard(), samples, roundTrip(Resolution::standard(), samples));
  expectBitEqual(samples, roundTrip(Resolution::lossless(), samples));
}

TEST(Chunk, valuesAtHalfAStepAndAtTheEndOfTheRange) {
  auto samples = smoothGesture(64);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].p_WT_m[0] = (static_cast<double>(i) + 0.5) * 1e-6;
    samples[i].p_WT_m[1] = (static_cast<double>(i) + 0.4999999) * -1e-6;
    samples[i].p_WT_m[2] = i % 2 ? 2147.483647 : -2147.483647;
  }
  expectClose(Resolution::standard(), samples, roundTrip(Resolution::standard(), samples));
}

TEST(Chunk, quaternionSignIsKept) {
  auto samples = smoothGesture(100);
  for (std::size_t i = 50; i < 100; ++i)
    for (double& component : samples[i].q_WT) component = -component;
  const auto back = roundTrip(Resolution::standard(), samples);
  for (std::size_t i = 0; i < 100; ++i) EXPECT_EQ(back[i].q_WT[3] < 0, i >= 50) << i;
}

TEST(Chunk, wallThatComesAndGoesKeepsItsGaps) {
  auto samples = smoothGesture(200);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t i = 0; i < samples.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k)
      samples[i].wall_W_m[k] = (i >> k) % 3 == 0 ? nan : 0.001 * static_cast<double>(i + k);
  expectClose(Resolution::standard(), samples, roundTrip(Resolution::standard(), samples));
  for (auto& s : samples) s.wall_W_m[0] = s.wall_W_m[1] = s.wall_W_m[2] = nan;
  expectClose(Resolution::standard(), samples, roundTrip(Resolution::standard(), samples));
}

TEST(Chunk, clockColumnsAreExactForAnyClock) {
  std::mt19937_64 random(7);
  auto samples = smoothGesture(300);
  const auto check = [&] {
    expectClose(Resolution::standard(), samples, roundTrip(Resolution::standard(), samples));
  };
  for (auto& s : samples) {
    s.tick = random();
    s.time_ns = static_cast<std::int64_t>(random());
  }
  check();
  // equal ticks, a clock that runs backwards, and the integer limits
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].tick = 42;
    samples[i].time_ns = -static_cast<std::int64_t>(i) * 999'983;
  }
  check();
  samples.front().time_ns = std::numeric_limits<std::int64_t>::min();
  samples.back().time_ns = std::numeric_limits<std::int64_t>::max();
  samples.front().tick = 0;
  samples.back().tick = std::numeric_limits<std::uint64_t>::max();
  check();
}

TEST(Chunk, regularClockWithMissedTicksCostsNothing) {
  auto samples = smoothGesture(1000);
  std::uint64_t tick = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i] = samples[0];
    tick += i % 100 == 99 ? 3 : 1;  // occasionally two ticks are missed
    samples[i].tick = tick;
    samples[i].time_ns = static_cast<std::int64_t>(tick) * 1'000'000;
  }
  const Bytes chunk = encodeChunk(Resolution::standard(), samples);
  expectClose(Resolution::standard(), samples, *decodeChunk(chunk));
  EXPECT_LT(chunk.size(), 44u + 4u + 90u + 4u * 32u + 10u * 20u);  // a few bytes per gap
}

TEST(Chunk, columnsThatDoNotFitAreStoredExactlyAndNamed) {
  auto samples = smoothGesture(100);
  samples[70].p_WT_m[1] = 2147.4836475;  // slightly more than one step too far
  samples[99].force_W_N[2] = -std::numeric_limits<double>::infinity();
  samples[3].q_WT[0] = std::numeric_limits<double>::quiet_NaN();
  samples[50].wall_W_m[0] = 1e300;
  samples[51].wall_W_m[0] = std::numeric_limits<double>::quiet_NaN();
  const Bytes chunk = encodeChunk(Resolution::standard(), samples);
  const auto info = inspectChunk(chunk);
  ASSERT_TRUE(info.ok());
  // columns: p 2-4, q 5-8, speed 9, force 10-12, torque 13-15, wall 16-18
  EXPECT_EQ(info->lossless_columns, (1u << 3) | (1u << 12) | (1u << 5) | (1u << 16));
  const auto back = decodeChunk(chunk);
  ASSERT_TRUE(back.ok());
  expectClose(Resolution::standard(), {samples.begin() + 4, samples.begin() + 50},
              {back->begin() + 4, back->begin() + 50});
  for (std::size_t i = 0; i < samples.size(); ++i) {
    ASSERT_TRUE(sameBits((*back)[i].p_WT_m[1], samples[i].p_WT_m[1])) << i;
    ASSERT_TRUE(sameBits((*back)[i].force_W_N[2], samples[i].force_W_N[2])) << i;
    ASSERT_TRUE(sameBits((*back)[i].q_WT[0], samples[i].q_WT[0])) << i;
    ASSERT_TRUE(sameBits((*back)[i].wall_W_m[0], samples[i].wall_W_m[0])) << i;
    ASSERT_TRUE(within((*back)[i].p_WT_m[0], samples[i].p_WT_m[0], 1e-6));
  }
}

TEST(Chunk, losslessGivesBackEveryBitOfAnything) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const auto samples = anySamples(1 + seed * 37, seed);
    expectBitEqual(samples, roundTrip(Resolution::lossless(), samples));
  }
  auto samples = smoothGesture(500);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].speed_mps = static_cast<double>(i) * std::numeric_limits<double>::denorm_min();
    samples[i].plunger = i % 2 ? -0.0 : 0.0;
    samples[i].force_W_N[0] =
        i % 2 ? std::numeric_limits<double>::max() : std::numeric_limits<double>::lowest();
  }
  expectBitEqual(samples, roundTrip(Resolution::lossless(), samples));
}

TEST(Chunk, encodingIsTotalForAnyBits) {
  for (std::uint64_t seed = 100; seed < 130; ++seed) {
    const auto samples = anySamples(1 + seed % 90, seed);
    const auto back = roundTrip(Resolution::standard(), samples);
    ASSERT_EQ(back.size(), samples.size());
    // random bits almost always contain a value beyond the steps, so most columns are exact; all are within
    // half a step
    for (std::size_t i = 0; i < samples.size(); ++i) {
      ASSERT_EQ(back[i].tick, samples[i].tick);
      const bool exact = sameBits(back[i].p_WT_m[0], samples[i].p_WT_m[0]);
      ASSERT_TRUE(exact || within(back[i].p_WT_m[0], samples[i].p_WT_m[0], 1e-6));
    }
  }
}

TEST(Chunk, mostSamplesAtOnce) {
  auto samples = smoothGesture(kMaxChunkSamples);
  const Bytes chunk = encodeChunk(Resolution::standard(), samples);
  EXPECT_EQ(inspectChunk(chunk)->count, kMaxChunkSamples);
  expectClose(Resolution::standard(), samples, *decodeChunk(chunk));
  const Bytes worst = encodeChunk(Resolution::lossless(), anySamples(kMaxChunkSamples, 3));
  EXPECT_LE(worst.size(), kMaxChunkBytes);
  EXPECT_TRUE(decodeChunk(worst).ok());
}

TEST(Chunk, storedSamplesEncodeToTheSameBytesAgain) {
  // A value rounded once stays on its step, so re-encoding a recording at the same resolution does not drift.
  const Bytes chunk = encodeChunk(Resolution::standard(), smoothGesture(500));
  EXPECT_EQ(encodeChunk(Resolution::standard(), *decodeChunk(chunk)), chunk);
}

TEST(Chunk, everyCorruptedByteIsDetected) {
  const Bytes good = encodeChunk(Resolution::standard(), smoothGesture(70));
  for (std::size_t at = 0; at < good.size(); ++at) {
    Bytes bad = good;
    for (int bit = 0; bit < 8; ++bit) {
      bad[at] = static_cast<std::uint8_t>(good[at] ^ (1 << bit));
      const auto result = decodeChunk(bad);
      ASSERT_FALSE(result.ok()) << at << " bit " << bit;
      ASSERT_FALSE(inspectChunk(bad).ok()) << at;
      ASSERT_TRUE(result.error().code == ErrorCode::kCorrupt ||
                  (at == 4 && result.error().code == ErrorCode::kVersion));
    }
  }
}

TEST(Chunk, everyTruncationAndEveryExtraByteIsRefused) {
  const Bytes good = encodeChunk(Resolution::standard(), smoothGesture(70));
  for (std::size_t size = 0; size < good.size(); ++size) {
    ASSERT_FALSE(decodeChunk(ByteView(good).first(size)).ok()) << size;
    // even if the truncated bytes have a matching CRC
    if (size < 4) continue;
    ASSERT_FALSE(
        decodeChunk(test::withGoodCrc({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size)})).ok())
        << size;
  }
  Bytes longer = good;
  longer.push_back(0);
  EXPECT_FALSE(decodeChunk(longer).ok());
  longer = good;
  longer.insert(longer.end() - 4, 0);
  const auto refused = decodeChunk(test::withGoodCrc(longer));
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("behind its last sample"), std::string::npos)
      << refused.error().message;
}

TEST(Chunk, cutOffBytesAreRefusedByName) {
  const Bytes good = encodeChunk(Resolution::standard(), smoothGesture(70));
  const auto refused = decodeChunk(ByteView(good).first(good.size() / 2));
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("cut off"), std::string::npos) << refused.error().message;
}

// Built from the bytes of version 1; nothing else changes.
TEST(Chunk, aCutMemoryMakesVersion2AndFollowsTheSteps) {
  const auto samples = smoothGesture(100);
  const std::pair<Resolution, std::ptrdiff_t> kinds[] = {
      {Resolution::standard(), 44}, {Resolution::lossless(), 44}, {{1e-5, 0x1p-12, 0, 1e-3, 1e-8, 1e-2}, 92}};
  for (const auto& [resolution, behind_steps] : kinds) {
    const Bytes plain = encodeChunk(resolution, samples);
    EXPECT_EQ(plain[4], 1);
    EXPECT_EQ(encodeChunk(resolution, samples, {}), plain);
    EXPECT_TRUE(cutMemoryOf(plain).empty());
    for (const std::size_t length : {std::size_t{1}, std::size_t{260}, kMaxCutMemoryBytes}) {
      SCOPED_TRACE(length);
      Bytes memory(length);
      for (std::size_t i = 0; i < length; ++i) memory[i] = static_cast<std::uint8_t>(7 * i + 1);
      Bytes expected = plain;
      expected[4] = 2;
      Bytes section = {static_cast<std::uint8_t>(length & 255), static_cast<std::uint8_t>(length >> 8)};
      section.insert(section.end(), memory.begin(), memory.end());
      expected.insert(expected.begin() + behind_steps, section.begin(), section.end());
      const Bytes chunk = encodeChunk(resolution, samples, memory);
      EXPECT_EQ(chunk, test::withGoodCrc(expected));
      EXPECT_EQ(cutMemoryOf(chunk), memory);
      const auto info = checkChunk(chunk);
      ASSERT_TRUE(info.ok()) << info.error().message;
      EXPECT_EQ(info->version, 2);
      EXPECT_EQ(claimedSamples(chunk), 100u);
      EXPECT_EQ(sealedSamples(chunk), 100u);
      expectBitEqual(*decodeChunk(plain), *decodeChunk(chunk));
      Bytes damaged = chunk;
      damaged[static_cast<std::size_t>(behind_steps) + 2] ^= 1;
      EXPECT_FALSE(decodeChunk(damaged).ok());
      EXPECT_TRUE(cutMemoryOf(damaged).empty());
    }
  }
}

TEST(Chunk, pathsMakeVersion3AndFollowTheCutMemory) {
  const auto samples = smoothGesture(100);
  const std::pair<Resolution, std::ptrdiff_t> kinds[] = {
      {Resolution::standard(), 44}, {Resolution::lossless(), 44}, {{1e-5, 0x1p-12, 0, 1e-3, 1e-8, 1e-2}, 92}};
  for (const auto& [resolution, behind_steps] : kinds) {
    const Bytes plain = encodeChunk(resolution, samples);
    EXPECT_TRUE(pathListOf(plain).empty());
    for (const Bytes& memory : {Bytes(), Bytes{1, 2, 3}}) {
      EXPECT_EQ(encodeChunk(resolution, samples, memory, {}), encodeChunk(resolution, samples, memory));
      for (const std::size_t length : {std::size_t{1}, std::size_t{700}, kMaxPathsBytes}) {
        SCOPED_TRACE(length);
        Bytes paths(length);
        for (std::size_t i = 0; i < length; ++i) paths[i] = static_cast<std::uint8_t>(5 * i + 3);
        Bytes expected = plain;
        expected[4] = 3;
        Bytes section = {static_cast<std::uint8_t>(memory.size()), 0};
        section.insert(section.end(), memory.begin(), memory.end());
        section.push_back(static_cast<std::uint8_t>(length & 255));
        section.push_back(static_cast<std::uint8_t>(length >> 8));
        section.insert(section.end(), paths.begin(), paths.end());
        expected.insert(expected.begin() + behind_steps, section.begin(), section.end());
        const Bytes chunk = encodeChunk(resolution, samples, memory, paths);
        EXPECT_EQ(chunk, test::withGoodCrc(expected));
        EXPECT_EQ(pathListOf(chunk), paths);
        EXPECT_EQ(cutMemoryOf(chunk), memory);
        const auto info = checkChunk(chunk);
        ASSERT_TRUE(info.ok()) << info.error().message;
        EXPECT_EQ(info->version, 3);
        EXPECT_EQ(sealedSamples(chunk), 100u);
        expectBitEqual(*decodeChunk(plain), *decodeChunk(chunk));
      }
    }
  }
}

TEST(Chunk, unknownVersionIsNamed) {
  Bytes chunk = encodeChunk(Resolution::standard(), smoothGesture(3));
  chunk[4] = 9;
  const auto refused = decodeChunk(test::withGoodCrc(chunk));
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kVersion);
  EXPECT_NE(refused.error().message.find("version 9"), std::string::npos);
}

TEST(Chunk, shortTextCannotAskForManySamples) {
  Bytes chunk = encodeChunk(Resolution::standard(), smoothGesture(3));
  chunk[6] = chunk[7] = 0xFF;  // claims 65,536 samples
  const auto refused = inspectChunk(test::withGoodCrc(chunk));
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("take at least"), std::string::npos) << refused.error().message;
}

TEST(Chunk, randomBytesNeverCrashTheReader) {
  std::mt19937_64 random(11);
  std::size_t readable = 0;
  for (int round = 0; round < 100'000; ++round) {
    Bytes bytes(random() % 400);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    // Half of them pass the first checks: a valid start, a small count, a matching CRC.
    if (round % 2 && bytes.size() >= 60) {
      const std::uint8_t start[] = {'N',
                                    'L',
                                    'G',
                                    'C',
                                    1,
                                    static_cast<std::uint8_t>(round % 8 == 1 ? 0 : 1),
                                    static_cast<std::uint8_t>(random() % 70),
                                    0};
      std::memcpy(bytes.data(), start, sizeof start);
      std::memset(bytes.data() + 40, 0, 4);
      bytes = test::withGoodCrc(bytes);
    }
    readable += decodeChunk(bytes).ok();
    (void)inspectChunk(bytes).ok();
  }
  EXPECT_LT(readable, 100u);
}

TEST(Chunk, changedColumnBytesNeverCrashTheReader) {
  // A valid chunk with some changed bytes and a corrected CRC reaches every branch of the column decoder.
  std::mt19937_64 random(12);
  const Bytes chunks[] = {encodeChunk(Resolution::standard(), smoothGesture(100)),
                          encodeChunk(Resolution::lossless(), anySamples(40, 5)),
                          encodeChunk(Resolution::standard(), anySamples(40, 6))};
  std::size_t refused = 0;
  for (int round = 0; round < 30'000; ++round) {
    Bytes bytes = chunks[round % 3];
    for (std::uint64_t n = 1 + random() % 3; n > 0; --n)
      bytes[8 + random() % (bytes.size() - 8)] = static_cast<std::uint8_t>(random());
    refused += !decodeChunk(test::withGoodCrc(bytes)).ok();
  }
  // Both results occur: invalid bytes, and other valid columns.
  EXPECT_GT(refused, 3'000u);
  EXPECT_LT(refused, 27'000u);
}

TEST(Chunk, tooManyOrNoSamplesAreAProgrammersError) {
#ifdef NDEBUG
  EXPECT_TRUE(encodeChunk(Resolution::standard(), {}).empty());
  EXPECT_TRUE(encodeChunk(Resolution::standard(), std::vector<GestureSample>(kMaxChunkSamples + 1)).empty());
#else
  EXPECT_DEATH((void)encodeChunk(Resolution::standard(), {}), "65,536");
#endif
}

}  // namespace
}  // namespace needlelab
