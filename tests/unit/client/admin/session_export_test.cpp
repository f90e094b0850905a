#include "client/admin/session_export.h"

#include <fstream>
#include <iterator>

#include "common/gesture/recording.h"
#include "common/gesture/sample_csv.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab {
namespace {

class SessionExport : public test::AdminTest {
 protected:
  std::string content(const std::string& name) const {
    std::ifstream in(file(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  /// All samples as they come back from chunks.
  static std::vector<GestureSample> samples(std::uint64_t chunks) {
    std::vector<GestureSample> all;
    for (std::uint64_t seq = 0; seq < chunks; ++seq) {
      const auto part = decodeChunk(test::chunkOf(seq));
      all.insert(all.end(), part->begin(), part->end());
    }
    return all;
  }
};

TEST_F(SessionExport, csvHoldsEverySample) {
  const std::string id = uuidText(addSession(5));
  good({"session", "export", id, "--format", "csv", "--out", file("g.csv")});
  std::string expected;
  appendSampleCsvHeader(expected);
  const auto all = samples(5);
  for (const auto& sample : all) appendSampleCsvRow(expected, sample, all.front().time_ns);
  EXPECT_EQ(content("g.csv"), expected);
}

TEST_F(SessionExport, jsonHoldsEverySampleAndTheSession) {
  const std::string id = uuidText(addSession(2));
  good({"session", "export", id, "--format", "json", "--out", file("g.json")});
  const auto whole = nlohmann::json::parse(content("g.json"));
  EXPECT_EQ(whole.at("version"), NEEDLELAB_VERSION);
  EXPECT_EQ(whole.at("session").at("session_id"), id);
  ASSERT_EQ(whole.at("rows").size(), 40u);
  EXPECT_EQ(whole.at("rows")[39].at("tick"), 39);
}

TEST_F(SessionExport, aRecordingHoldsTheVeryChunks) {
  const std::string id = uuidText(addSession(3));
  good({"session", "export", id, "--format", "recording", "--out", file("g.nlg")});
  const auto reader = RecordingReader::open(file("g.nlg"));
  ASSERT_OK(reader);
  EXPECT_TRUE(reader->complete());
  ASSERT_EQ(reader->entries().size(), 3u);
  EXPECT_EQ(*reader->chunkBytes(2), test::chunkOf(2));
  EXPECT_EQ(nlohmann::json::parse(reader->metadata()).at("session_id"), id);
}

TEST_F(SessionExport, emptyAndOpenSessionsCanBeExported) {
  const std::string empty = uuidText(addSession(0));
  good({"session", "export", empty, "--format", "json", "--out", file("e.json")});
  EXPECT_TRUE(nlohmann::json::parse(content("e.json")).at("rows").empty());
  const std::string open = uuidText(addSession(2, true));
  EXPECT_NE(good({"session", "export", open, "--out", file("o.csv")}).err.find("still open"),
            std::string::npos);
  EXPECT_FALSE(content("o.csv").empty());
}

TEST_F(SessionExport, aDamagedSessionLeavesNoFileAndNoOldOneIsLost) {
  const std::string crc = uuidText(addSession(3, false, "UPDATE chunks SET crc = 1 WHERE seq = 2"));
  const std::string wrong_hash = uuidText(addSession(3, false, "UPDATE sessions SET hash = zeroblob(32)"));
  folder.write("old.csv", "old");
  for (const std::string& id : {crc, wrong_hash}) {
    for (const char* format : {"csv", "json", "recording"}) {
      const Run result = onData({"session", "export", id, "--format", format, "--out", file("old.csv")});
      EXPECT_EQ(result.code, 1) << format;
      EXPECT_EQ(content("old.csv"), "old");
    }
  }
  int files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path())) ++files;
  EXPECT_EQ(files, 2) << "something is left beside the folder and the old file";
}

}  // namespace
}  // namespace needlelab
