// Parts of sessions, and sessions with damage.
#include <fstream>
#include <iterator>

#include "common/base/csv.h"
#include "common/gesture/recording.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab {
namespace {

class RangeOfExport : public test::AdminTest {
 protected:
  std::string content(const std::string& name) const {
    std::ifstream in(file(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  /// The ticks of an exported JSON.
  std::vector<std::uint64_t> ticks(const std::string& name) const {
    std::vector<std::uint64_t> all;
    const auto whole = nlohmann::json::parse(content(name));
    for (const auto& row : whole.at("rows")) all.push_back(row.at("tick"));
    return all;
  }
  static std::vector<std::uint64_t> range(std::uint64_t from, std::uint64_t to) {
    std::vector<std::uint64_t> all;
    for (std::uint64_t tick = from; tick < to; ++tick) all.push_back(tick);
    return all;
  }
};

// chunkOf(): a sample each ms, 20 a chunk, ticks from 0
TEST_F(RangeOfExport, fromAndToCutAtTheSample) {
  const std::string id = uuidText(addSession(50));
  good({"session", "export", id, "--format", "json", "--from", "0.333", "--to", "0.5", "--out",
        file("a.json")});
  EXPECT_EQ(ticks("a.json"), range(333, 500));
  good({"session", "export", id, "--format", "json", "--from", "0.9", "--out", file("a.json")});
  EXPECT_EQ(ticks("a.json"), range(900, 1000));
  good({"session", "export", id, "--format", "json", "--to", "0.0205", "--out", file("a.json")});
  EXPECT_EQ(ticks("a.json"), range(0, 21));
  good({"session", "export", id, "--format", "json", "--from", "7", "--out", file("a.json")});
  EXPECT_TRUE(ticks("a.json").empty());
  // times of a part count from the session's first sample
  good({"session", "export", id, "--from", "0.5", "--to", "0.502", "--out", file("a.csv")});
  const std::string csv = content("a.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
  EXPECT_NE(csv.find("\n0.5,500,"), std::string::npos) << csv;
  // a recording has whole chunks
  good({"session", "export", id, "--format", "recording", "--from", "0.333", "--to", "0.5", "--out",
        file("a.nlg")});
  const auto reader = RecordingReader::open(file("a.nlg"));
  ASSERT_OK(reader);
  ASSERT_EQ(reader->entries().size(), 9u);
  EXPECT_EQ(reader->entries().front().first_tick, 320u);
  EXPECT_EQ(reader->entries().back().last_tick, 499u);
}

TEST_F(RangeOfExport, badRangesAreWrongInput) {
  const std::string id = uuidText(addSession(2));
  for (const auto& [from, to] :
       {std::pair{"-1", "2"}, std::pair{"3", "2"}, std::pair{"nan", "2"}, std::pair{"1", "1e99"}}) {
    const Run bad = onData({"session", "export", id, "--from", from, "--to", to, "--out", file("x")});
    EXPECT_EQ(bad.code, 2) << from << " " << to << ": " << bad.err;
    EXPECT_FALSE(std::filesystem::exists(file("x")));
  }
}

TEST_F(RangeOfExport, damagedChunksAreNamedAndTheRestWritten) {
  const std::string id = uuidText(addSession(
      50, false, "UPDATE chunks SET crc = 1 WHERE seq IN (3, 4); DELETE FROM chunks WHERE seq = 20"));
  const Run refused = onData({"session", "export", id, "--format", "json", "--out", file("d.json")});
  EXPECT_EQ(refused.code, 1);
  EXPECT_NE(refused.err.find("chunk 3"), std::string::npos) << refused.err;
  EXPECT_NE(refused.err.find("--damaged"), std::string::npos) << refused.err;
  EXPECT_FALSE(std::filesystem::exists(file("d.json")));

  const Run around =
      onData({"session", "export", id, "--format", "json", "--damaged", "--out", file("d.json")});
  EXPECT_EQ(around.code, 1);
  for (const char* chunk : {"chunk 3", "chunk 4", "chunk 20", "3 of 50 chunks"})
    EXPECT_NE(around.err.find(chunk), std::string::npos) << around.err;
  auto expected = range(0, 60);
  for (const auto tick : range(100, 400)) expected.push_back(tick);
  for (const auto tick : range(420, 1000)) expected.push_back(tick);
  EXPECT_EQ(ticks("d.json"), expected);
  // a part without damage is sound
  EXPECT_EQ(
      onData({"session", "export", id, "--format", "json", "--from", "0.5", "--out", file("d.json")}).code,
      0);
  EXPECT_EQ(ticks("d.json"), range(500, 1000));
  // the first chunk, too
  const std::string first = uuidText(addSession(5, false, "UPDATE chunks SET crc = 1 WHERE seq = 0"));
  EXPECT_EQ(
      onData({"session", "export", first, "--format", "json", "--damaged", "--out", file("f.json")}).code, 1);
  EXPECT_EQ(ticks("f.json"), range(20, 100));
  // check names them all, and exits 1
  const Run check = onData({"check"});
  EXPECT_EQ(check.code, 1);
  for (const char* chunk : {"chunk 3:", "chunk 4:", "chunk 20:", "chunk 0:"})
    EXPECT_NE(check.out.find(chunk), std::string::npos) << check.out;
}

TEST_F(RangeOfExport, aHashThatDisagreesIsNamedToo) {
  const std::string id = uuidText(addSession(3, false, "UPDATE sessions SET hash = zeroblob(32)"));
  EXPECT_EQ(onData({"session", "export", id, "--out", file("h.csv")}).code, 1);
  EXPECT_FALSE(std::filesystem::exists(file("h.csv")));
  EXPECT_EQ(onData({"session", "export", id, "--damaged", "--out", file("h.csv")}).code, 1);
  EXPECT_TRUE(std::filesystem::exists(file("h.csv")));
}

}  // namespace
}  // namespace needlelab
