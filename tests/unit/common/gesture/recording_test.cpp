#include "common/gesture/recording.h"

#include <gtest/gtest.h>
#include <algorithm>

#include <cstring>
#include <fstream>

#include "common/base/bytes.h"
#include "common/base/files/files.h"
#include "common/gesture/recording_format.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/common/gesture/gesture_samples.h"

namespace needlelab {
namespace {

namespace fs = std::filesystem;
using test::smoothGesture;

class Recording : public testing::Test {
 protected:
  // Writes a finished recording of small chunks; keeps their samples for comparison.
  fs::path write(std::size_t chunks, std::size_t samples_a_chunk,
                 const std::string& metadata = R"({"exercise":"e1"})") {
    const fs::path path = folder_ / "gesture.rec";
    auto writer = RecordingWriter::create(path, metadata);
    EXPECT_TRUE(writer.ok());
    chunks_.clear();
    for (std::size_t i = 0; i < chunks; ++i) {
      chunks_.push_back(encodeChunk(Resolution::standard(), smoothGesture(samples_a_chunk, i + 1)));
      EXPECT_TRUE(writer->append(chunks_.back()).ok());
    }
    EXPECT_TRUE(writer->finish().ok());
    return path;
  }
  static Bytes load(const fs::path& path) {
    const std::string text = *readWholeFile(path);
    return {text.begin(), text.end()};
  }
  fs::path store(ByteView bytes, const char* name = "changed.rec") const {
    const fs::path path = folder_ / name;
    std::ofstream(path, std::ios::binary) << textOf(bytes);
    return path;
  }

  const test::TempFolder temp_;
  const fs::path folder_ = temp_.path();
  std::vector<Bytes> chunks_;
};

TEST_F(Recording, completeFileGivesBackMetadataAndChunks) {
  const std::string metadata = R"({"note":"tremor ≤ 50 µm"})";
  const auto reader = RecordingReader::open(write(3, 40, metadata));
  ASSERT_TRUE(reader.ok());
  EXPECT_TRUE(reader->complete());
  EXPECT_EQ(reader->metadata(), metadata);
  EXPECT_EQ(reader->unusableTailBytes(), 0u);
  EXPECT_EQ(reader->sampleCount(), 120u);
  EXPECT_TRUE(reader->damages().empty());
  ASSERT_EQ(reader->entries().size(), 3u);
  SessionHash hash;
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(*reader->chunkBytes(i), chunks_[i]);
    EXPECT_EQ(reader->samples(i)->size(), 40u);
    EXPECT_EQ(reader->entries()[i].first_tick, 1000u);
    EXPECT_EQ(reader->entries()[i].last_tick, 1039u);
    hash.update(chunks_[i]);
  }
  EXPECT_EQ(reader->declaredHash(), hash.digest());
  EXPECT_EQ(reader->allSamples()->size(), 120u);
  EXPECT_TRUE(reader->verify().ok());
  EXPECT_FALSE(reader->chunkBytes(3).ok());
}

TEST_F(Recording, emptyRecordingIsComplete) {
  const auto reader = RecordingReader::open(write(0, 0, ""));
  ASSERT_TRUE(reader.ok());
  EXPECT_TRUE(reader->complete());
  EXPECT_TRUE(reader->entries().empty());
  EXPECT_TRUE(reader->verify().ok());
}

TEST_F(Recording, cutAtEveryByteGivesEveryWholeChunkBeforeTheCut) {
  const fs::path path = write(4, 12);
  const Bytes whole = load(path);
  const auto complete = RecordingReader::open(path);
  ASSERT_TRUE(complete.ok());
  for (std::size_t size = 0; size <= whole.size(); ++size) {
    SCOPED_TRACE("cut at " + std::to_string(size));
    const auto reader = RecordingReader::open(store(ByteView(whole).first(size)));
    ASSERT_TRUE(reader.ok()) << reader.error().message;
    EXPECT_EQ(reader->complete(), size == whole.size());
    // expected: the chunks whose record (16 bytes before, 4 after) ends before the cut
    std::size_t expected = 0;
    std::uint64_t end = 0;
    for (const RecordingEntry& entry : complete->entries())
      if (entry.offset + 20 + entry.bytes <= size) {
        ++expected;
        end = entry.offset + 20 + entry.bytes;
      }
    ASSERT_EQ(reader->entries().size(), expected);
    for (std::size_t i = 0; i < expected; ++i) ASSERT_EQ(*reader->chunkBytes(i), chunks_[i]);
    EXPECT_TRUE(reader->damages().empty());
    EXPECT_TRUE(reader->verify().ok());
    EXPECT_EQ(reader->metadata(), size < 16 + 20 + 17 ? "" : R"({"exercise":"e1"})");
    if (expected > 0 && expected < 4) {
      EXPECT_EQ(reader->unusableTailBytes(), size - end);
    }
  }
}

TEST_F(Recording, zerosBehindACutAreAnUnusableTail) {
  // The state after a power cut if the file's length was written, but not its data.
  const fs::path path = write(3, 12);
  const auto complete = RecordingReader::open(path);
  ASSERT_TRUE(complete.ok());
  Bytes bytes = load(path);
  const RecordingEntry last = complete->entries()[2];
  bytes.resize(last.offset + 30);
  bytes.resize(bytes.size() + 5000);
  const auto reader = RecordingReader::open(store(bytes));
  ASSERT_TRUE(reader.ok());
  EXPECT_EQ(reader->entries().size(), 2u);
  EXPECT_EQ(reader->unusableTailBytes(), 5030u);
  EXPECT_TRUE(reader->damages().empty());
}

TEST_F(Recording, damagedChunkIsNamedAndTheOthersStayReadable) {
  const fs::path path = write(4, 12);
  const auto complete = RecordingReader::open(path);
  ASSERT_TRUE(complete.ok());
  const RecordingEntry hit = complete->entries()[1];
  for (const bool cut : {false, true}) {
    for (const std::uint64_t within : {std::uint64_t{2}, std::uint64_t{9}, std::uint64_t{16},
                                       std::uint64_t{60}, 19 + std::uint64_t{hit.bytes}}) {
      SCOPED_TRACE("byte " + std::to_string(within) + (cut ? ", cut" : ""));
      Bytes bytes = load(path);
      bytes[hit.offset + within] ^= 0x10;
      if (cut) bytes.resize(bytes.size() - 10);
      const auto reader = RecordingReader::open(store(bytes));
      ASSERT_TRUE(reader.ok());
      EXPECT_EQ(reader->complete(), !cut);
      const Status verified = reader->verify();
      ASSERT_FALSE(verified.ok());
      EXPECT_EQ(verified.error().code, ErrorCode::kCorrupt);
      EXPECT_NE(verified.error().message.find("changed.rec"), std::string::npos);
      EXPECT_NE(verified.error().message.find("chunk 1"), std::string::npos) << verified.error().message;
      EXPECT_NE(verified.error().message.find("offset " + std::to_string(hit.offset)), std::string::npos);
      // Without index and header the reader cannot recognise the damaged chunk; it then counts it as one
      // damage.
      const bool lost = cut && within < 16;
      ASSERT_EQ(reader->entries().size(), lost ? 3u : 4u);
      EXPECT_EQ(reader->damages().size(), cut ? 1u : 0u);
      for (std::size_t i = 0; i < 4; ++i) {
        if (i == 1) continue;
        const auto chunk = reader->chunkBytes(lost && i > 1 ? i - 1 : i);
        ASSERT_TRUE(chunk.ok());
        EXPECT_EQ(*chunk, chunks_[i]);
      }
      if (!lost) {
        EXPECT_FALSE(reader->samples(1).ok());
      }
    }
  }
}

TEST_F(Recording, aLengthBeyondTheFileHidesNoGoodRecordBehindIt) {
  // bytes are missing from the second chunk's record: the length in its header points beyond the end of the
  // file
  const fs::path path = write(4, 12);
  const auto entries = RecordingReader::open(path)->entries();
  Bytes bytes = load(path);
  const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(entries[1].offset);
  const std::uint32_t length = static_cast<std::uint32_t>(bytes.size());
  std::memcpy(&*begin + 8, &length, 4);
  const std::uint32_t crc = crc32c(ByteView(bytes).subspan(entries[1].offset, 12));
  std::memcpy(&*begin + 12, &crc, 4);
  for (const bool cut : {false, true}) {
    // without an index, and cut off within the last chunk
    const auto end = cut ? entries[3].offset + 30 : bytes.size() - 1;
    const auto reader =
        RecordingReader::open(store(Bytes(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(end))));
    ASSERT_TRUE(reader.ok());
    ASSERT_EQ(reader->entries().size(), cut ? 2u : 3u);
    EXPECT_EQ(*reader->chunkBytes(0), chunks_[0]);
    EXPECT_EQ(*reader->chunkBytes(1), chunks_[2]);
    ASSERT_EQ(reader->damages().size(), 1u);
    EXPECT_EQ(reader->damages().front().offset, entries[1].offset);
    EXPECT_EQ(reader->damages().front().bytes, entries[2].offset - entries[1].offset);
    if (cut) {
      EXPECT_EQ(reader->unusableTailBytes(), 30u);
    }
    EXPECT_FALSE(reader->verify().ok());
  }
}

TEST_F(Recording, everyChangedByteIsNoticed) {
  const fs::path path = write(2, 8);
  const Bytes whole = load(path);
  for (std::size_t at = 0; at < whole.size(); ++at) {
    SCOPED_TRACE("byte " + std::to_string(at));
    Bytes bytes = whole;
    bytes[at] ^= 0x40;
    const auto reader = RecordingReader::open(store(bytes));
    if (!reader.ok()) {
      EXPECT_LT(at, 16u) << reader.error().message;
      continue;
    }
    EXPECT_TRUE(!reader->verify().ok() || !reader->complete());
    // damage in one place costs at most one chunk
    std::size_t readable = 0;
    for (std::size_t i = 0; i < reader->entries().size(); ++i) readable += reader->samples(i).ok();
    EXPECT_GE(readable, 1u);
  }
}

TEST_F(Recording, wrongHashInTheIndexIsFoundByVerify) {
  // an index with valid CRCs but another hash: only comparing it with the chunks reveals it
  const fs::path path = write(2, 8);
  Bytes bytes = load(path);
  std::uint64_t index_offset;
  std::memcpy(&index_offset, bytes.data() + bytes.size() - 24, 8);
  const std::size_t content = index_offset + 16, length = 8 + 2 * 32 + 32;
  bytes[content + length - 1] ^= 1;
  const std::uint32_t crc = crc32c(ByteView(bytes).subspan(content, length));
  std::memcpy(bytes.data() + content + length, &crc, 4);
  const auto reader = RecordingReader::open(store(bytes));
  ASSERT_TRUE(reader.ok());
  ASSERT_TRUE(reader->complete());
  const Status verified = reader->verify();
  ASSERT_FALSE(verified.ok());
  EXPECT_NE(verified.error().message.find("hash"), std::string::npos);
}

TEST_F(Recording, otherFilesAreRefusedByName) {
  EXPECT_EQ(RecordingReader::open(folder_ / "none.rec").error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(RecordingReader::open(folder_).error().code, ErrorCode::kInvalidInput);
  const auto text = RecordingReader::open(store(viewOf("t_s,px_m,py_m\n0,1,2\n")));
  ASSERT_FALSE(text.ok());
  EXPECT_NE(text.error().message.find("changed.rec: is not a needlelab recording"), std::string::npos);
  Bytes later = load(write(1, 4));
  later[8] = 2;
  const std::uint32_t crc = crc32c(ByteView(later).first(12));
  std::memcpy(later.data() + 12, &crc, 4);
  EXPECT_EQ(RecordingReader::open(store(later)).error().code, ErrorCode::kVersion);
}

TEST_F(Recording, unknownRecordsAreSkipped) {
  // a later minor version may add records: here one of kind 77 between two chunks of a cut-off file
  const fs::path path = write(2, 8);
  const auto complete = RecordingReader::open(path);
  ASSERT_TRUE(complete.ok());
  const RecordingEntry second = complete->entries()[1];
  const Bytes whole = load(path);
  Bytes bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(second.offset));
  Bytes extra(whole.begin() + static_cast<std::ptrdiff_t>(second.offset),
              whole.begin() + static_cast<std::ptrdiff_t>(second.offset + 20 + second.bytes));
  const Bytes chunk = extra;
  extra[4] = 77;
  const std::uint32_t crc = crc32c(ByteView(extra).first(12));
  std::memcpy(extra.data() + 12, &crc, 4);
  bytes.insert(bytes.end(), extra.begin(), extra.end());
  bytes.insert(bytes.end(), chunk.begin(), chunk.end());
  const auto reader = RecordingReader::open(store(bytes));
  ASSERT_TRUE(reader.ok());
  EXPECT_EQ(reader->entries().size(), 2u);
  EXPECT_EQ(*reader->chunkBytes(1), chunks_[1]);
  EXPECT_TRUE(reader->verify().ok());
}

TEST_F(Recording, atomicWriterLeavesNothingUnlessFinished) {
  const fs::path path = folder_ / "a.rec";
  {
    auto writer = RecordingWriter::create(path, "{}");
    ASSERT_TRUE(writer.ok());
    ASSERT_TRUE(writer->append(encodeChunk(Resolution::standard(), smoothGesture(5))).ok());
    EXPECT_FALSE(fs::exists(path));
    const RecordingWriter moved = std::move(*writer);
    EXPECT_EQ(moved.chunks(), 1u);
  }
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(Recording, openEndedWriterLeavesAReadableFileAtAnyTime) {
  const fs::path path = folder_ / "b.rec";
  {
    auto writer = RecordingWriter::create(path, "{}", RecordingWriter::Mode::kOpenEnded);
    ASSERT_TRUE(writer.ok());
    for (std::size_t n = 1; n <= 3; ++n) {
      ASSERT_TRUE(writer->append(encodeChunk(Resolution::standard(), smoothGesture(5))).ok());
      ASSERT_TRUE(writer->sync().ok());
      const auto reader = RecordingReader::open(path);
      ASSERT_TRUE(reader.ok());
      EXPECT_FALSE(reader->complete());
      EXPECT_EQ(reader->entries().size(), n);
      EXPECT_EQ(reader->unusableTailBytes(), 0u);
    }
    EXPECT_EQ(RecordingWriter::create(path, "{}", RecordingWriter::Mode::kOpenEnded).error().code,
              ErrorCode::kAlreadyExists);
  }
  EXPECT_TRUE(fs::exists(path));
}

TEST_F(Recording, writerRefusesBadChunksAndWorkAfterTheEnd) {
  auto writer = RecordingWriter::create(folder_ / "c.rec", "{}");
  ASSERT_TRUE(writer.ok());
  Bytes bad = encodeChunk(Resolution::standard(), smoothGesture(5));
  bad.back() ^= 1;
  const Status refused = writer->append(bad);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("chunk 0 is not written"), std::string::npos);
  ASSERT_TRUE(writer->finish().ok());
  EXPECT_FALSE(writer->append(encodeChunk(Resolution::standard(), smoothGesture(5))).ok());
  EXPECT_FALSE(writer->finish().ok());
  EXPECT_TRUE(RecordingReader::open(folder_ / "c.rec")->verify().ok());
  EXPECT_FALSE(RecordingWriter::create(folder_ / "no" / "d.rec", "{}").ok());
  EXPECT_EQ(
      RecordingWriter::create(folder_ / "d.rec", std::string(kMaxRecordingMetadata + 1, ' ')).error().code,
      ErrorCode::kInvalidInput);
}

TEST_F(Recording, oversizedMetadataIsNamedDamageAndChunksStayReadable) {
  using namespace recording_format;
  const Bytes chunk = encodeChunk(Resolution::standard(), smoothGesture(12));
  // same limit as the writer's, which refuses such metadata
  const auto recordingWith = [&](std::size_t metadata_bytes, bool complete) {
    Bytes file, index;
    putStart(file);
    putRecord(file, kMetadata, Bytes(metadata_bytes, ' '));
    const std::uint64_t chunk_at = file.size();
    putRecord(file, kChunk, chunk);
    if (!complete) return store(file);
    SessionHash hash;
    hash.update(chunk);
    ByteWriter entries(index);
    entries.put(std::uint64_t{1});
    entries.put(chunk_at);
    entries.put(static_cast<std::uint32_t>(chunk.size()));
    entries.put(std::uint32_t{12});
    entries.put(std::uint64_t{1000});
    entries.put(std::uint64_t{1011});
    entries.put(ByteView(hash.digest()));
    const std::uint64_t index_at = file.size();
    putRecord(file, kIndex, index);
    putFooter(file, index_at);
    return store(file);
  };
  for (const bool complete : {true, false}) {
    SCOPED_TRACE(complete ? "complete" : "cut off");
    const auto most = RecordingReader::open(recordingWith(kMaxRecordingMetadata, complete));
    ASSERT_TRUE(most.ok());
    EXPECT_EQ(most->metadata().size(), kMaxRecordingMetadata);
    EXPECT_TRUE(most->verify().ok());
    for (const std::size_t bytes : {kMaxRecordingMetadata + 1, kMaxRecordBytes}) {
      const auto reader = RecordingReader::open(recordingWith(bytes, complete));
      ASSERT_TRUE(reader.ok());
      EXPECT_EQ(reader->complete(), complete);
      EXPECT_EQ(reader->metadata(), "");
      ASSERT_EQ(reader->damages().size(), 1u);
      EXPECT_EQ(reader->damages()[0].offset, kStartBytes);
      EXPECT_NE(reader->damages()[0].what.find(std::to_string(bytes) + " bytes of metadata"),
                std::string::npos)
          << reader->damages()[0].what;
      ASSERT_EQ(reader->entries().size(), 1u);
      EXPECT_EQ(*reader->chunkBytes(0), chunk);
      EXPECT_EQ(reader->verify().error().code, ErrorCode::kCorrupt);
    }
  }
}

TEST_F(Recording, whatIsDamagedBetweenTwoChunksIsOneDamageHoweverManyRecords) {
  using namespace recording_format;
  constexpr std::uint8_t kPrivate = 200;
  const Bytes chunk = encodeChunk(Resolution::standard(), smoothGesture(12));
  Bytes file;
  const auto put = [&](std::uint8_t kind, ByteView content, bool good) {
    putRecord(file, kind, content);
    if (!good) file.back() ^= 1;
  };
  putStart(file);
  put(kMetadata, viewOf("{}"), true);
  put(kChunk, chunk, true);
  const std::uint64_t begin = file.size();
  for (int i = 0; i < 1000; ++i) {
    put(kPrivate, {}, false);
    put(kPrivate, {}, true);
    put(kChunk, {}, false);
  }
  const std::uint64_t end = file.size();
  put(kChunk, chunk, true);
  const std::uint64_t begin_of_second = file.size();
  put(kPrivate, {}, false);
  put(kPrivate, {}, true);
  const std::uint64_t end_of_second = file.size();
  put(kPrivate, {}, false);
  const auto reader = RecordingReader::open(store(file));
  ASSERT_TRUE(reader.ok());
  ASSERT_EQ(reader->entries().size(), 1002u) << "numbers of chunks do not change";
  EXPECT_EQ(*reader->chunkBytes(0), chunk);
  EXPECT_EQ(*reader->chunkBytes(1001), chunk);
  ASSERT_EQ(reader->damages().size(), 2u);
  EXPECT_EQ(reader->damages()[0].offset, begin);
  EXPECT_EQ(reader->damages()[0].offset + reader->damages()[0].bytes, end);
  EXPECT_EQ(reader->damages()[1].offset, begin_of_second);
  EXPECT_EQ(reader->damages()[1].offset + reader->damages()[1].bytes, end_of_second);
  EXPECT_EQ(reader->unusableTailBytes(), file.size() - end_of_second);
}

TEST_F(Recording, randomDamageNeverCrashesTheReaderOrInventsSamples) {
  const auto path = write(3, 20);
  const Bytes whole = load(path);
  std::vector<Bytes> written;
  {
    const auto reader = RecordingReader::open(path);
    ASSERT_TRUE(reader.ok());
    for (std::size_t i = 0; i < reader->entries().size(); ++i) written.push_back(*reader->chunkBytes(i));
    ASSERT_EQ(written.size(), 3u);
  }
  std::mt19937_64 random(5);
  for (int round = 0; round < 2000; ++round) {
    Bytes bytes = whole;
    for (std::uint64_t n = random() % 6; n > 0; --n)
      bytes[16 + random() % (bytes.size() - 16)] = static_cast<std::uint8_t>(random());
    if (round % 3 == 0) bytes.resize(random() % bytes.size());
    const auto reader = RecordingReader::open(store(bytes));
    if (!reader.ok()) continue;
    (void)reader->verify().ok();
    for (std::size_t i = 0; i < reader->entries().size(); ++i) {
      (void)reader->samples(i).ok();
      const auto chunk = reader->chunkBytes(i);
      if (!chunk.ok()) continue;
      ASSERT_NE(std::find(written.begin(), written.end(), *chunk), written.end()) << "round " << round;
    }
  }
}

}  // namespace
}  // namespace needlelab
