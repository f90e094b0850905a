// Spool files that no station wrote: they must not delay the next start by minutes, and their readable part
// must be kept.
#include <gmock/gmock.h>

#include <fstream>

#include "client/net/spool/spool.h"
#include "common/base/files/files.h"
#include "common/gesture/chunk.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/net/spool/spool_samples.h"

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

Bytes coded(std::uint64_t first, std::size_t count) {
  return encodeChunk(Resolution::standard(), samplesFrom(first, count));
}

// A session with one chunk of 100 samples, left by a program that died. Returns its folder.
fs::path sessionOfOneChunk(const fs::path& folder) {
  auto spool = Spool::open(folder);
  EXPECT_TRUE(spool.ok());
  auto session = *(*spool)->create(describeSession(makeUuidV7()));
  EXPECT_TRUE(session->appendChunk(coded(0, 100), 100).ok());
  EXPECT_TRUE(session->sync().ok());
  return session->folder();
}

// Each chunk made from a tail costs a sync, some 20 ms: a tail of 4,000 chunks delayed the lesson by 90 s.
TEST(SpoolTail, ofManyChunksGivesAFewAndKeepsTheRest) {
  const TempFolder folder;
  const fs::path session = sessionOfOneChunk(folder.path());
  constexpr std::uint64_t kChunks = 4'000, kMade = 8;
  {
    auto tail = std::move(*SpoolFile::open(session / "tail"));
    for (std::uint64_t k = 0; k < kChunks; ++k) ASSERT_TRUE(tail.append(1 + k, 0, coded(100 + k, 1)).ok());
  }
  const auto as_found = *readWholeFile(session / "tail");
  for (int start = 0; start < 2; ++start) {
    SCOPED_TRACE(start);
    auto spool = std::move(*Spool::open(folder.path()));
    ASSERT_EQ(spool->unfinished().size(), 1u);
    const SpoolContents contents = spool->unfinished().front()->contents();
    EXPECT_EQ(contents.chunks, 1 + kMade);
    EXPECT_EQ(contents.samples, 100 + kMade);
    EXPECT_TRUE(contents.interrupted);
    EXPECT_EQ(contents.damage, (SpoolDamage{0, kChunks - kMade, 100 + kMade}));
    EXPECT_EQ(*readWholeFile(session / "tail.damaged"), as_found);
    if (start == 0) {
      EXPECT_THAT(spool->notes(), testing::Contains(HasSubstr("tail.damaged")));
    }
  }
}

TEST(SpoolTail, keepsPieceOrderWhenTwoChunksAreInterleaved) {
  const TempFolder folder;
  const fs::path session = sessionOfOneChunk(folder.path());
  {
    // pieces of chunk 2 lie before and between those of chunk 1; one piece occurs twice
    auto tail = std::move(*SpoolFile::open(session / "tail"));
    ASSERT_TRUE(tail.append(2, 0, coded(130, 10)).ok());
    ASSERT_TRUE(tail.append(1, 0, coded(100, 10)).ok());
    ASSERT_TRUE(tail.append(1, 1, coded(110, 10)).ok());
    ASSERT_TRUE(tail.append(2, 1, coded(140, 10)).ok());
    ASSERT_TRUE(tail.append(1, 1, coded(110, 10)).ok());
    ASSERT_TRUE(tail.append(1, 2, coded(120, 10)).ok());
  }
  auto spool = std::move(*Spool::open(folder.path()));
  ASSERT_EQ(spool->unfinished().size(), 1u);
  const auto found = spool->unfinished().front();
  EXPECT_EQ(found->contents().chunks, 3u);
  EXPECT_EQ(found->contents().damage, SpoolDamage{});
  std::uint64_t tick = 0;
  for (std::uint64_t seq = 0; seq < 3; ++seq) {
    const auto chunk = found->readChunk(seq);
    ASSERT_TRUE(chunk.ok());
    const auto samples = decodeChunk(*chunk);
    ASSERT_TRUE(samples.ok());
    for (const GestureSample& sample : *samples) ASSERT_EQ(sample.tick, tick++);
  }
  EXPECT_EQ(tick, 150u);
  EXPECT_FALSE(fs::exists(session / "tail.damaged"));
}

// Record headers of half a MiB, one in every eight bytes: 130 GB would be read.
TEST(SpoolTail, ofFalseRecordHeadersIsAbandonedAndLeftAsItIs) {
  const TempFolder folder;
  const fs::path session = sessionOfOneChunk(folder.path());
  std::string bytes;
  for (std::size_t i = 0; i < (2u << 20) / 8; ++i) bytes.append("NLS1\0\0\x08\0", 8);
  std::ofstream(session / "tail", std::ios::binary) << bytes;
  const auto chunks = *readWholeFile(session / "chunks");
  auto spool = std::move(*Spool::open(folder.path()));
  EXPECT_TRUE(spool->unfinished().empty());
  EXPECT_THAT(spool->notes(), testing::ElementsAre(testing::AllOf(HasSubstr("only look like records"),
                                                                  HasSubstr("left as it is"))));
  EXPECT_EQ(*readWholeFile(session / "tail"), bytes);
  EXPECT_EQ(*readWholeFile(session / "chunks"), chunks);
}

// As many bad places as a failing disk makes in a long session: the good records between them are found.
TEST(SpoolTail, goodRecordsBetweenManyFalseBeginningsAreFound) {
  const TempFolder folder;
  const fs::path path = folder.path() / "records";
  constexpr std::size_t kRecords = 500;
  {
    auto file = std::move(*SpoolFile::open(path));
    for (std::size_t i = 0; i < kRecords; ++i) ASSERT_TRUE(file.append(i, 0, Bytes(100)).ok());
  }
  const std::string record = *readWholeFile(path);
  const std::size_t each = record.size() / kRecords;
  std::string bytes;
  for (std::size_t i = 0; i < kRecords; ++i)
    bytes += std::string("NLS1\xf0\x00\x08\x00", 8) + record.substr(i * each, each);
  std::ofstream(path, std::ios::binary) << bytes;
  std::size_t found = 0;
  const auto end = std::move(*SpoolFile::open(path)).scan([&](const SpoolRecord& good) {
    EXPECT_EQ(good.seq, found);
    ++found;
    return true;
  });
  ASSERT_TRUE(end.ok()) << end.error().message;
  EXPECT_EQ(*end, bytes.size());
  EXPECT_EQ(found, kRecords);
}

}  // namespace
}  // namespace needlelab::test
