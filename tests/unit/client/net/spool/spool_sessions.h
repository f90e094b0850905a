/// Sessions in a spool for its tests, and what the next start recovers of them.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "client/net/spool/spool.h"
#include "common/gesture/chunk.h"
#include "tests/unit/client/net/spool/spool_samples.h"

namespace needlelab::test {

inline std::unique_ptr<Spool> opened(const std::filesystem::path& folder) {
  auto spool = Spool::open(folder);
  EXPECT_TRUE(spool.ok()) << spool.error().message;
  return spool.ok() ? std::move(*spool) : nullptr;
}

inline Bytes coded(std::uint64_t first, std::size_t count) {
  return encodeChunk(Resolution::standard(), samplesFrom(first, count));
}

/// What the next start recovers: all samples of the one session, in order.
struct Recovered {
  SpoolContents contents;
  std::vector<GestureSample> samples;
  std::vector<Bytes> chunks;
};
inline Recovered recover(const std::filesystem::path& folder) {
  Recovered found;
  auto spool = opened(folder);
  const auto sessions = spool->unfinished();
  EXPECT_EQ(sessions.size(), 1u);
  if (sessions.size() != 1) return found;
  found.contents = sessions[0]->contents();
  SessionHash hash;
  for (std::uint64_t seq = 0; seq < found.contents.chunks; ++seq) {
    auto chunk = sessions[0]->readChunk(seq);
    EXPECT_TRUE(chunk.ok());
    auto samples = decodeChunk(*chunk);
    EXPECT_TRUE(samples.ok());
    found.samples.insert(found.samples.end(), samples->begin(), samples->end());
    hash.update(*chunk);
    found.chunks.push_back(*chunk);
  }
  EXPECT_EQ(found.contents.hash, hash.digest());
  EXPECT_EQ(found.contents.samples, found.samples.size());
  return found;
}

/// The samples are in order, and the spool counts those missing between them.
inline void expectTicksButTheMissing(const Recovered& found) {
  std::uint64_t tick = 0, missing = 0;
  for (const GestureSample& sample : found.samples) {
    ASSERT_GE(sample.tick, tick);
    ASSERT_TRUE(isSampleOfItsTick(sample)) << sample.tick;
    missing += sample.tick - tick;
    tick = sample.tick + 1;
  }
  ASSERT_EQ(found.contents.damage.samples, missing);
}

inline void expectTicksFromZero(const std::vector<GestureSample>& samples) {
  for (std::size_t i = 0; i < samples.size(); ++i) {
    ASSERT_EQ(samples[i].tick, i);
    ASSERT_TRUE(isSampleOfItsTick(samples[i])) << i;
  }
}

/// Three chunks of 100 samples, synced one by one or all at the end; the program ended the session or
/// crashed. Returns the session's folder.
inline std::filesystem::path sessionOfThreeChunks(const std::filesystem::path& folder, bool ended,
                                                  bool synced_each = true) {
  auto spool = opened(folder);
  auto made = *spool->create(describeSession(makeUuidV7()));
  for (std::uint64_t k = 0; k < 3; ++k) {
    EXPECT_TRUE(made->appendChunk(coded(100 * k, 100), 100).ok());
    if (synced_each) {
      EXPECT_TRUE(made->sync().ok());
    }
  }
  EXPECT_TRUE(made->sync().ok());
  if (ended) {
    EXPECT_TRUE(made->end(false).ok());
  }
  return made->folder();
}

}  // namespace needlelab::test
