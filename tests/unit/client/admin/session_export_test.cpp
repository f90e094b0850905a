#include <gmock/gmock.h>

#include <cstdlib>
#include <fstream>
#include <iostream>
#include <thread>

#include "client/admin/session_export.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/text/csv.h"
#include "common/base/time/clock.h"
#include "common/gesture/recording.h"
#include "common/gesture/sample.h"
#include "server/base/log.h"
#include "server/server.h"
#include "tests/support/run_form.h"
#include "tests/support/sanitized.h"
#include "tests/unit/client/admin/run_admin.h"

namespace needlelab {
namespace {

class SessionExport : public test::AdminTest {
 protected:
  std::string content(const std::string& name) const { return *readWholeFile(file(name)); }
  /// Returns all samples decoded from the chunks.
  static std::vector<GestureSample> samples(std::uint64_t chunks) {
    std::vector<GestureSample> all;
    for (std::uint64_t seq = 0; seq < chunks; ++seq) {
      const auto part = decodeChunk(test::chunkOf(seq));
      all.insert(all.end(), part->begin(), part->end());
    }
    return all;
  }
};

TEST_F(SessionExport, csvOfEveryTickHoldsEverySample) {
  const std::string id = uuidText(addSession(5));
  good({"session", "export", id, "--every-tick", "--format", "csv", "--out", file("g.csv")});
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
  EXPECT_EQ(whole.at("version"), programVersion());
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

TEST_F(SessionExport, theFilesNameDeterminesTheFormat) {
  const std::string id = uuidText(addSession(2));
  good({"session", "export", id, "--out", file("x.nlrec")});
  EXPECT_OK(RecordingReader::open(file("x.nlrec")));
  good({"session", "export", id, "--out", file("x.json")});
  EXPECT_TRUE(content("x.json").starts_with("{"));
  good({"session", "export", id, "--out", file("x.CSV")});
  EXPECT_TRUE(content("x.CSV").starts_with("t_s,"));
  good({"session", "export", id, "--out", file("x.txt")});
  EXPECT_TRUE(content("x.txt").starts_with("t_s,"));
  const Run refused = onData({"session", "export", id, "--format", "csv", "--out", file("y.nlrec")});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, testing::HasSubstr("the name says recording, --format says csv"));
  EXPECT_FALSE(std::filesystem::exists(file("y.nlrec")));
}

TEST_F(SessionExport, aDamagedSessionLeavesNoFileAndNoOldOneIsLost) {
  const std::string crc = uuidText(addSession(3, false, "UPDATE chunks SET crc = 1 WHERE seq = 2"));
  const std::string wrong_hash = uuidText(addSession(3, false, "UPDATE sessions SET hash = zeroblob(32)"));
  folder.write("old", "old");
  for (const std::string& id : {crc, wrong_hash}) {
    for (const char* format : {"csv", "json", "recording", "hdf5"}) {
      const Run result =
          onData({"session", "export", id, "--format", format, "--out", file("old"), "--replace"});
      EXPECT_EQ(result.code, 1) << format;
      EXPECT_EQ(content("old"), "old");
    }
  }
  int files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path())) ++files;
  EXPECT_EQ(files, 2) << "something is left beside the folder and the old file";
}

class RangeOfExport : public test::AdminTest {
 protected:
  std::string content(const std::string& name) const { return *readWholeFile(file(name)); }
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

// chunkOf(): a sample each ms, 20 per chunk, ticks from 0
TEST_F(RangeOfExport, fromAndToCutAtTheSample) {
  const std::string id = uuidText(addSession(50));
  good({"session", "export", id, "--format", "json", "--from", "0.333", "--to", "0.5", "--out",
        file("a.json"), "--replace"});
  EXPECT_EQ(ticks("a.json"), range(333, 500));
  good({"session", "export", id, "--format", "json", "--from", "0.9", "--out", file("a.json"), "--replace"});
  EXPECT_EQ(ticks("a.json"), range(900, 1000));
  good({"session", "export", id, "--format", "json", "--to", "0.0205", "--out", file("a.json"), "--replace"});
  EXPECT_EQ(ticks("a.json"), range(0, 21));
  good({"session", "export", id, "--format", "json", "--from", "7", "--out", file("a.json"), "--replace"});
  EXPECT_TRUE(ticks("a.json").empty());
  // Times in a part count from the first sample of the session.
  good({"session", "export", id, "--every-tick", "--from", "0.5", "--to", "0.502", "--out", file("a.csv")});
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
  // the numbers in its metadata are the session's, and the metadata say so
  const auto metadata = nlohmann::json::parse(reader->metadata());
  EXPECT_EQ(metadata.at("samples"), 1000);
  EXPECT_EQ(metadata.at("part").at("from_s"), 0.333);
  EXPECT_EQ(metadata.at("part").at("to_s"), 0.5);
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
  // A part without damage verifies.
  EXPECT_EQ(onData({"session", "export", id, "--format", "json", "--from", "0.5", "--out", file("d.json"),
                    "--replace"})
                .code,
            0);
  EXPECT_EQ(ticks("d.json"), range(500, 1000));
  // also damage the first chunk
  const std::string first = uuidText(addSession(5, false, "UPDATE chunks SET crc = 1 WHERE seq = 0"));
  EXPECT_EQ(
      onData({"session", "export", first, "--format", "json", "--damaged", "--out", file("f.json")}).code, 1);
  EXPECT_EQ(ticks("f.json"), range(20, 100));
  // `check` lists them all and exits with 1.
  const Run check = onData({"check"});
  EXPECT_EQ(check.code, 1);
  for (const char* chunk : {"chunk 3:", "chunk 4:", "chunk 20:", "chunk 0:"})
    EXPECT_NE(check.out.find(chunk), std::string::npos) << check.out;
}

TEST_F(RangeOfExport, aHashThatDisagreesIsNamedToo) {
  const std::string id = uuidText(addSession(3, false, "UPDATE sessions SET hash = zeroblob(32)"));
  EXPECT_EQ(onData({"session", "export", id, "--damaged", "--out", file("h.csv")}).code, 1);
  EXPECT_TRUE(std::filesystem::exists(file("h.csv")));
}

class ExportMemory : public test::AdminTest {
 protected:
  /// Adds a session of this many seconds at 1 kHz.
  Uuid addLong(std::uint64_t seconds) const {
    auto store = test::TestDb::must(Store::open(data(), {}));
    const Uuid id = makeUuidV7();
    EXPECT_OK(store->writer().run([&](Connection& c) -> Status {
      if (const auto known = StationStore(c).find("station-1"); known.ok() && !known->has_value()) {
        if (auto added = StationStore(c).add("station-1", StationKeyBytes{}, 1); !added) return added;
      }
      SessionStore sessions(c);
      if (auto opened = sessions.open(test::describe(id), 1); !opened) return opened.error();
      for (std::uint64_t seq = 0; seq < seconds; ++seq) {
        if (auto appended = sessions.append(id, seq, test::chunkOf(seq, 1000)); !appended)
          return appended.error();
      }
      pb::CloseSession close;
      close.set_session_id(test::bytesOfId(id));
      close.set_chunks(seconds);
      close.set_samples(1000 * seconds);
      const auto hashed = sessions.hashChunks(id, seconds);
      if (!hashed) return hashed.error();
      close.set_hash(hashed->hash.data(), hashed->hash.size());
      const auto closed = sessions.closeHashed(close, 2, {}, *hashed);
      return closed ? Status() : Status(closed.error());
    }));
    return id;
  }
  static std::uint64_t statusKiB(const std::string& key) {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);) {
      if (line.rfind(key + ":", 0) == 0) return std::strtoull(line.c_str() + key.size() + 1, nullptr, 10);
    }
    return 0;
  }
  /// Returns the peak memory of the process while `work` runs.
  template <typename Work>
  static std::uint64_t peakKiB(const Work& work) {
    std::ofstream("/proc/self/clear_refs") << "5";
    work();
    return statusKiB("VmHWM");
  }
};

TEST_F(ExportMemory, doesNotGrowWithTheLength) {
  const bool lengthy = test::longForm();
  const std::uint64_t seconds = lengthy ? 3600 : 360;
  const auto password = folder.write("pw", "correct horse").string();
  good({"user", "add", "ines", "--role", "instructor", "--password-file", password});
  const std::string minute = uuidText(addLong(60)), longer = uuidText(addLong(seconds));
  ServerOptions options;
  options.data = data();
  options.listen = "127.0.0.1:0";
  setLogLevel(LogLevel::kOff);
  auto server = Server::start(options);
  ASSERT_OK(server);
  std::thread thread([&] { EXPECT_EQ((*server)->run(), 0); });

  const auto take = [&](const std::string& id, const std::string& format, std::uint64_t samples) {
    const std::string out = file("out");
    const Run run = this->run({"--server", "127.0.0.1:" + std::to_string((*server)->port()), "--ca",
                               (*server)->caFile().string(), "--user", "ines", "--password-file", password,
                               "session", "export", id, "--format", format, "--out", out});
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_NE(run.out.find("wrote " + std::to_string(samples) + " samples"), std::string::npos) << run.out;
    std::cout << run.out;
    std::filesystem::remove(out);
  };
  take(longer, "csv", 1000 * seconds);  // fills SQLite's page cache
  for (const std::string format : {"csv", "json", "hdf5"}) {
    take(minute, format, 60'000);  // fills pools
    const auto small = peakKiB([&] { take(minute, format, 60'000); });
    const auto large = peakKiB([&] { take(longer, format, 1000 * seconds); });
    std::cout << format << ": peak " << small << " KiB for a minute, " << large << " KiB for " << seconds / 60
              << " minutes\n";
    // keeping the longer session in memory would take this much for its samples alone
    const auto kept_KiB = (1000 * seconds - 60'000) * sizeof(GestureSample) / 1024;
    if (!test::kSanitized) {
      EXPECT_LT(large, small + kept_KiB / 4) << format;
    }
  }
  (*server)->stop();
  thread.join();
}

}  // namespace

}  // namespace needlelab
