// Damaged recordings: refused, or read with every gap listed.
#include "common/gesture/whole_recording.h"

#include <gmock/gmock.h>

#include <limits>
#include <span>

#include "common/base/files/files.h"
#include "common/gesture/chunk.h"
#include "common/gesture/pose_track.h"
#include "common/gesture/recording.h"
#include "tests/support/realtime/no_alloc.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::size_t kPerChunk = 100;

/// One and a half seconds of motion at 1 kHz, ticks from 17 on.
std::vector<GestureSample> someSamples(std::size_t count) {
  std::vector<GestureSample> samples(count);
  for (std::size_t i = 0; i < count; ++i) {
    samples[i].tick = 17 + i;
    samples[i].time_ns = 5'000'000'000 + static_cast<std::int64_t>(i) * 1'000'000;
    samples[i].p_WT_m[2] = 1e-3 * static_cast<double>(i % 50);
    samples[i].plunger = 1e-3 * static_cast<double>(i % 1000);
  }
  return samples;
}

class WholeRecording : public testing::Test {
 protected:
  /// Writes `chunks` chunks of 100 samples; the metadata claim the content `declared`.
  std::filesystem::path write(std::size_t chunks, const std::string& metadata = {}) {
    const auto path = folder_.path() / "whole.nlrec";
    const auto samples = someSamples(chunks * kPerChunk);
    std::vector<Bytes> made;
    SessionHash hash;
    for (std::size_t i = 0; i < chunks; ++i) {
      made.push_back(
          encodeChunk(Resolution::lossless(), std::span(samples).subspan(i * kPerChunk, kPerChunk)));
      hash.update(made.back());
    }
    const std::string declared = R"({"samples":)" + std::to_string(samples.size()) + R"(,"chunks":)" +
                                 std::to_string(chunks) + R"(,"hash":")" + hexOf(hash.digest()) + "\"}";
    auto writer = RecordingWriter::create(path, metadata.empty() ? declared : metadata);
    EXPECT_TRUE(writer.ok());
    for (const Bytes& chunk : made) EXPECT_TRUE(writer->append(chunk).ok());
    EXPECT_TRUE(writer->finish().ok());
    return path;
  }
  std::filesystem::path changed(const std::string& bytes) { return folder_.write("changed.nlrec", bytes); }
  const test::TempFolder folder_;
};

TEST_F(WholeRecording, aWholeOneHasNoHole) {
  for (const char* const metadata : {"", "{}", R"({"study":"s","session":"0001"})"}) {
    const auto read = readRecording(write(3, metadata));
    ASSERT_TRUE(read.ok()) << read.error().message;
    EXPECT_EQ(read->samples.size(), 300u);
    EXPECT_THAT(read->holes, IsEmpty());
  }
}

TEST_F(WholeRecording, everyTruncationIsRefusedAndItsHoleNamed) {
  const std::string whole = *readWholeFile(write(5));
  const auto entries = RecordingReader::open(folder_.path() / "whole.nlrec")->entries();
  for (std::size_t cut = 0; cut <= 200; ++cut) {
    const std::size_t size = cut * (whole.size() - 1) / 200;
    SCOPED_TRACE(size);
    const auto path = changed(whole.substr(0, size));
    EXPECT_FALSE(readRecording(path).ok());
    std::size_t readable = 0;  // chunks with an intact record
    for (const RecordingEntry& entry : entries) readable += entry.offset + 16 + entry.bytes + 4 <= size;
    const auto rest = readRecording(path, DamagedRecording::kRead);
    if (readable == 0) {
      EXPECT_FALSE(rest.ok());
      continue;
    }
    ASSERT_TRUE(rest.ok()) << rest.error().message;
    EXPECT_EQ(rest->samples.size(), readable * kPerChunk);
    ASSERT_FALSE(rest->holes.empty());
    EXPECT_THAT(rest->holes.front(),
                HasSubstr("ticks from " + std::to_string(17 + readable * kPerChunk) + " on"));
  }
}

TEST_F(WholeRecording, aFlippedHeaderBitLeavesAHoleOfItsTicks) {
  const std::string whole = *readWholeFile(write(5));
  const auto entries = RecordingReader::open(folder_.path() / "whole.nlrec")->entries();
  for (const bool cut : {false, true}) {
    for (std::size_t within = 0; within < 16; ++within) {
      SCOPED_TRACE("byte " + std::to_string(within) + (cut ? ", without an index" : ""));
      std::string bytes = whole;
      bytes[entries[2].offset + within] = static_cast<char>(bytes[entries[2].offset + within] ^ 0x10);
      if (cut) bytes.resize(bytes.size() - 3);
      const auto path = changed(bytes);
      const auto refused = readRecording(path);
      ASSERT_FALSE(refused.ok());
      EXPECT_EQ(refused.error().code, ErrorCode::kCorrupt);
      EXPECT_THAT(refused.error().message,
                  AllOf(HasSubstr("changed.nlrec"), HasSubstr("400 samples can be read"),
                        HasSubstr("ticks 217 to 316")));
      const auto rest = readRecording(path, DamagedRecording::kRead);
      ASSERT_TRUE(rest.ok());
      EXPECT_EQ(rest->samples.size(), 400u);
    }
  }
}

TEST_F(WholeRecording, consecutiveDamagedChunksAreOneHoleWithOrWithoutIndex) {
  const std::string whole = *readWholeFile(write(6));
  const auto entries = RecordingReader::open(folder_.path() / "whole.nlrec")->entries();
  for (const bool cut : {false, true}) {
    SCOPED_TRACE(cut ? "without an index" : "with its index");
    std::string bytes = whole;
    for (const std::size_t chunk : {std::size_t{1}, std::size_t{2}, std::size_t{4}}) {
      char& within = bytes[entries[chunk].offset + 40];
      within = static_cast<char>(within ^ 0x10);
    }
    if (cut) bytes.resize(bytes.size() - 3);
    const auto rest = readRecording(changed(bytes), DamagedRecording::kRead);
    ASSERT_TRUE(rest.ok()) << rest.error().message;
    EXPECT_EQ(rest->samples.size(), 300u);
    ASSERT_GE(rest->holes.size(), 2u);
    EXPECT_THAT(rest->holes[0], AllOf(HasSubstr("ticks 117 to 316"), HasSubstr("chunk 1")));
    EXPECT_THAT(rest->holes[1], AllOf(HasSubstr("ticks 417 to 516"), HasSubstr("chunk 4")));
  }
}

TEST_F(WholeRecording, theMetadataRevealsAChunkMissingWithoutTrace) {
  // the file without its index and without the bytes of the third chunk's record
  const std::string whole = *readWholeFile(write(5));
  const auto entries = RecordingReader::open(folder_.path() / "whole.nlrec")->entries();
  const std::string bytes = whole.substr(0, entries[2].offset) + whole.substr(entries[3].offset);
  const auto rest = readRecording(changed(bytes), DamagedRecording::kRead);
  ASSERT_TRUE(rest.ok());
  EXPECT_EQ(rest->samples.size(), 400u);
  EXPECT_THAT(rest->holes, testing::Contains(AllOf(HasSubstr("400 samples can be read, its metadata say 500"),
                                                   HasSubstr("no chunk has the ticks 217 to 316"))));
}

TEST_F(WholeRecording, isHeldAgainstEachNumberOfItsMetadata) {
  for (const auto& [metadata, hole] :
       {std::pair{R"({"samples":301})", "300 samples can be read, its metadata say 301"},
        std::pair{R"({"chunks":4})", "3 chunks can be read, its metadata say 4"},
        std::pair{R"({"hash":"00"})", "its metadata say 00"}, std::pair{"[]", "not a JSON object"}}) {
    const auto refused = readRecording(write(3, metadata));
    ASSERT_FALSE(refused.ok()) << metadata;
    EXPECT_THAT(refused.error().message, HasSubstr(hole));
  }
  // a part has the whole session's numbers
  EXPECT_TRUE(readRecording(write(3, R"({"samples":301,"part":{"from_s":1,"to_s":null}})")).ok());
}

TEST_F(WholeRecording, metadataTakeNoMemoryForEachLevelThatTheyNest) {
  constexpr std::size_t kLevels = 300'000;
  const std::string deep = std::string(kLevels, '[') + std::string(kLevels, ']');
  const auto path = write(3, R"({"samples":300,"a":)" + deep + "}");
  std::uint64_t calls = 0;
  const auto read = [&] {
    const test::NoAllocScope scope;
    auto whole = readRecording(path);
    calls = scope.calls();
    return whole;
  }();
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read->samples.size(), 300u);
  EXPECT_LT(calls, kLevels / 10) << "calls of the heap";
  const auto refused = readRecording(write(3, R"({"a":)" + deep + R"(,"samples":301})"));
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr("300 samples can be read, its metadata say 301"));
}

TEST_F(WholeRecording, isReplayedExactlyThroughTheCurrentTool) {
  const auto path = write(2);
  // the tip is 0.1 m in front of the grip; the handle is turned half about x against it
  const Pose X_HT{{0, 0, 0.1}, {1, 0, 0, 0}};
  const auto track = readRecordedTrack(path, X_HT);
  ASSERT_TRUE(track.ok()) << track.error().message;
  const auto samples = someSamples(200);
  ASSERT_EQ(track->t_s.size(), 200u);
  const std::vector<Pose> poses = resamplePoses(*track, 1000);
  ASSERT_EQ(poses.size(), 200u);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_NEAR(track->t_s[i], 1e-3 * static_cast<double>(i), 1e-12);
    const Pose X_WT = poses[i] * X_HT;
    for (std::size_t k = 0; k < 3; ++k) {
      const double tip = k == 0 ? X_WT.p.x : k == 1 ? X_WT.p.y : X_WT.p.z;
      EXPECT_NEAR(tip, samples[i].p_WT_m[k], 1e-12);
    }
    EXPECT_EQ(track->plunger[i], samples[i].plunger);
  }
  EXPECT_TRUE(beginsAsRecording(path));
  EXPECT_FALSE(beginsAsRecording(folder_.write("a.csv", "t_s,px_m\n")));
  EXPECT_FALSE(beginsAsRecording(folder_.path() / "none"));
}

TEST_F(WholeRecording, whatADeviceCannotPlayIsRefusedByItsSample) {
  const auto refusal = [&](auto change) {
    auto samples = someSamples(10);
    change(samples);
    auto writer = RecordingWriter::create(folder_.path() / "odd.nlrec", "{}");
    EXPECT_TRUE(writer.ok());
    if (!samples.empty()) {
      EXPECT_TRUE(writer->append(encodeChunk(Resolution::lossless(), samples)).ok());
    }
    EXPECT_TRUE(writer->finish().ok());
    const auto track = readRecordedTrack(folder_.path() / "odd.nlrec", {});
    EXPECT_FALSE(track.ok());
    return track.ok() ? std::string() : track.error().message;
  };
  using Samples = std::vector<GestureSample>;
  EXPECT_THAT(refusal([](Samples& s) { s[4].time_ns = s[2].time_ns; }),
              AllOf(HasSubstr("sample 5 (tick 21)"), HasSubstr("times must ascend")));
  EXPECT_THAT(refusal([](Samples& s) { s[3].p_WT_m[1] = std::numeric_limits<double>::quiet_NaN(); }),
              AllOf(HasSubstr("sample 4"), HasSubstr("-1000 to 1000 m")));
  EXPECT_THAT(refusal([](Samples& s) { s[3].q_WT[3] = 0.5; }), HasSubstr("0.999 to 1.001"));
  EXPECT_THAT(refusal([](Samples& s) { s[3].plunger = 1.5; }), HasSubstr("allowed is 0 to 1"));
  EXPECT_THAT(refusal([](Samples& s) { s.clear(); }), HasSubstr("no samples"));
}

// A chunk of 65,536 equal samples takes 8 kB: 55 of them hold more than an hour at 1 kHz, and 700 MB of
// samples.
TEST_F(WholeRecording, moreThanAnHourIsRefusedBeforeAllocation) {
  const auto path = folder_.path() / "long.nlrec";
  const std::uint64_t chunks = kMaxReadSamples / kMaxChunkSamples + 1;
  {
    auto writer = RecordingWriter::create(path, "{}");
    ASSERT_TRUE(writer.ok());
    std::vector<GestureSample> samples(kMaxChunkSamples);
    for (std::uint64_t i = 0; i < chunks; ++i) {
      for (std::size_t k = 0; k < samples.size(); ++k) {
        samples[k].tick = i * kMaxChunkSamples + k;
        samples[k].time_ns = static_cast<std::int64_t>(samples[k].tick) * 1'000'000;
      }
      ASSERT_TRUE(writer->append(encodeChunk(Resolution{}, samples)).ok());
    }
    ASSERT_TRUE(writer->finish().ok());
  }
  const auto refusesIt = [&](const std::filesystem::path& file) {
    const auto expected =
        AllOf(HasSubstr(file.string()), HasSubstr(std::to_string(chunks * kMaxChunkSamples)),
              HasSubstr("at most 3600000"), HasSubstr("--from --to"));
    std::size_t shown = 0;
    for (const auto damaged : {DamagedRecording::kRefuse, DamagedRecording::kRead}) {
      const auto read = readRecording(file, damaged);
      ASSERT_FALSE(read.ok());
      EXPECT_EQ(read.error().code, ErrorCode::kInvalidInput);
      EXPECT_THAT(read.error().message, expected);
      EXPECT_FALSE(readRecordingByChunk(file, damaged, [&](std::span<const GestureSample> samples) {
                     shown += samples.size();
                     return Status();
                   }).ok());
    }
    EXPECT_EQ(shown, 0u) << "nothing is decoded first";
    const auto track = readRecordedTrack(file, {});
    ASSERT_FALSE(track.ok());
    EXPECT_THAT(track.error().message, expected);
  };
  refusesIt(path);
  // without the index the chunks themselves state how much they hold
  std::string bytes = *readWholeFile(path);
  EXPECT_LT(bytes.size(), 1u << 20);
  bytes.resize(bytes.size() - 3);
  refusesIt(changed(bytes));
}

TEST_F(WholeRecording, isShownChunkByChunk) {
  std::vector<std::size_t> shown;
  const auto holes =
      readRecordingByChunk(write(3), DamagedRecording::kRefuse, [&](std::span<const GestureSample> samples) {
        shown.push_back(samples.size());
        return Status();
      });
  ASSERT_TRUE(holes.ok()) << holes.error().message;
  EXPECT_THAT(*holes, IsEmpty());
  EXPECT_THAT(shown, ElementsAre(kPerChunk, kPerChunk, kPerChunk));
  const auto ended =
      readRecordingByChunk(write(3), DamagedRecording::kRefuse, [](std::span<const GestureSample>) -> Status {
        return Error{ErrorCode::kFailed, "enough"};
      });
  ASSERT_FALSE(ended.ok());
  EXPECT_EQ(ended.error().message, "enough");
}

}  // namespace
}  // namespace needlelab
