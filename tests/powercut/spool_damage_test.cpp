// Flipped bits in every file of a spool: never a crash, never wrong samples, other sessions unharmed.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <set>

#include "client/net/spool/lesson_cache.h"
#include "client/net/spool/spool.h"
#include "common/gesture/chunk.h"
#include "tests/powercut/campaign.h"
#include "tests/unit/client/net/spool/spool_samples.h"

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;

Uuid idOf(std::uint8_t session) {
  Uuid id{};
  id[6] = 0x70;
  id[8] = 0x80;
  id[15] = session;
  return id;
}

/// Session 1 ended, 2 cut off with a tail, 3 ended and partly acknowledged, and a lesson.
void makeSpool(const fs::path& folder) {
  auto spool = std::move(*Spool::open(folder));
  for (const std::uint8_t number : {1, 2, 3}) {
    auto session = *spool->create(describeSession(idOf(number)));
    for (std::uint64_t seq = 0; seq < 5; ++seq) {
      ASSERT_TRUE(
          session->appendChunk(encodeChunk(Resolution::standard(), samplesFrom(seq * 100, 100)), 100).ok());
      ASSERT_TRUE(session->restartTail().ok());
    }
    ASSERT_TRUE(session->sync().ok());
    if (number == 2) {
      ASSERT_TRUE(session->appendPiece(5, encodeChunk(Resolution::standard(), samplesFrom(500, 20))).ok());
      continue;
    }
    if (number == 3) {
      ASSERT_TRUE(session->setLoss({7, 500}).ok());
      ASSERT_TRUE(session->setReceipt({2, 1, false, 0}).ok());
    }
    ASSERT_TRUE(session->end(false).ok());
  }
  pb::Lesson lesson;
  lesson.set_exercise_json(R"({"id": "knee-1"})");
  lesson.set_profile_json(R"({"id": "knee", "stiffness": 1250})");
  ASSERT_TRUE(LessonCache(folder).keep("knee-1", lesson).ok());
}

TEST(SpoolDamage, aFlippedBitAffectsOnlyItsOwnFile) {
  const std::uint64_t seed = seedOr(20261126);
  const TempFolder original;
  makeSpool(original.path());
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(original.path()))
    if (entry.is_regular_file() && entry.file_size() > 0)
      files.push_back(fs::relative(entry.path(), original.path()));
  std::sort(files.begin(), files.end());
  Random random(seed);
  for (const fs::path& file : files) {
    const int tries = longForm() ? 400 : 25;
    int shorter = 0;
    for (int i = 0; i < tries; ++i) {
      const TempFolder folder;
      fs::copy(original.path(), folder.path(),
               fs::copy_options::recursive | fs::copy_options::overwrite_existing);
      const auto target = folder.path() / file;
      const std::uint64_t offset = random.below(fs::file_size(target));
      const int bit = 1 << random.below(8);
      {
        std::fstream stream(target, std::ios::binary | std::ios::in | std::ios::out);
        stream.seekg(static_cast<std::streamoff>(offset));
        const int byte = stream.get();
        stream.seekp(static_cast<std::streamoff>(offset));
        stream.put(static_cast<char>(byte ^ bit));
      }
      const std::string where =
          file.string() + ", byte " + std::to_string(offset) + ", bit " + std::to_string(bit);
      const auto lesson = LessonCache(folder.path()).find("knee-1");
      if (lesson.ok()) {
        EXPECT_EQ(lesson->profile_json(), R"({"id": "knee", "stiffness": 1250})") << where;
      }
      auto opened = Spool::open(folder.path());
      ASSERT_TRUE(opened.ok()) << where << ": " << opened.error().message;
      std::set<std::uint8_t> seen;
      for (const auto& session : (*opened)->unfinished()) {
        const std::uint8_t number = session->id()[15];
        seen.insert(number);
        const bool hit = file.string().find(session->idText()) != std::string::npos;
        const SpoolContents contents = session->contents();
        std::uint64_t tick = 0, gap = 0;
        for (std::uint64_t seq = 0; seq < contents.chunks; ++seq) {
          const auto bytes = session->readChunk(seq);
          ASSERT_TRUE(bytes.ok()) << where << ": " << bytes.error().message;
          const auto samples = decodeChunk(*bytes);
          ASSERT_TRUE(samples.ok()) << where;
          for (const GestureSample& sample : *samples) {
            ASSERT_GE(sample.tick, tick) << where;
            gap += sample.tick - tick;
            tick = sample.tick + 1;
            ASSERT_TRUE(isSampleOfItsTick(sample)) << where;
          }
        }
        if (!hit) {
          EXPECT_EQ(tick, number == 2 ? 520u : 500u) << where;
          EXPECT_EQ(contents.interrupted, number == 2) << where;
        }
        // only the files of the recording itself can cost samples
        const auto name = file.filename();
        if (hit && name != "chunks" && name != "tail") {
          EXPECT_EQ(tick, number == 2 ? 520u : 500u) << where;
        }
        // damage in chunks is counted to the sample, and everything else is there
        const std::uint64_t missing = contents.damage.samples;
        EXPECT_EQ(contents.samples + gap, tick) << where;
        EXPECT_GE(missing, gap) << where;
        if (hit && name == "chunks") {
          EXPECT_EQ(contents.samples + missing, number == 2 ? 520u : 500u) << where;
        }
        shorter += missing > 0 || tick < (number == 2 ? 520u : 500u) ? 1 : 0;
        // a shortened session is not reported as complete
        if (contents.samples < 500) {
          EXPECT_TRUE(contents.interrupted) << where;
        }
      }
      // a damaged description has a copy, so every session is uploaded; repairs are reported
      EXPECT_EQ(seen, (std::set<std::uint8_t>{1, 2, 3})) << where;
      if (file.filename() == "session.json") {
        const std::string id = file.parent_path().filename().string();
        bool said = false;
        for (const std::string& note : (*opened)->notes())
          said |= note.find(id) != std::string::npos && note.find("from its copy") != std::string::npos;
        EXPECT_TRUE(said) << where;
      }
    }
    std::printf("  %-55s %3d flips: %d shorter\n", file.c_str(), tries, shorter);
  }
}

}  // namespace
}  // namespace needlelab::test
