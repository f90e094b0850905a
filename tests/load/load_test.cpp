// Real servers under load: no sample is lost, and planted faults are found.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "common/base/files/files.h"
#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"
#include "db/sessions/session_store.h"
#include "tests/integration/process.h"
#include "tests/load/load_report.h"
#include "tests/load/load_run.h"
#include "tests/load/server/database_check.h"
#include "tests/load/server/own_server.h"
#include "tests/support/store/postgres_database.h"
#include "tests/support/temp_folder.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;

class LoadProgram : public testing::Test {
 protected:
  int run(const std::vector<std::string>& arguments) {
    Process load("needlelab-load", arguments, folder_.path() / "said");
    const int code = load.wait().value_or(-1000);
    said_ = load.said();
    return code;
  }
  // the server that it started
  static pid_t childOf(pid_t parent) {
    std::ifstream children(fmt::format("/proc/{}/task/{}/children", parent, parent));
    pid_t child = 0;
    children >> child;
    return child;
  }
  static bool streams(const Process& load) {
    return eventually([&] { return load.said().find("0 s: ") != std::string::npos; }, 60s);
  }
  [[nodiscard]] nlohmann::json json() const {
    auto text = readWholeFile(folder_.path() / "json");
    return text.ok() ? nlohmann::json::parse(*text, nullptr, false) : nlohmann::json();
  }
  TempFolder folder_;
  std::string said_;
};

TEST_F(LoadProgram, aStalledServerShowsInTheLatenciesAndNothingIsLost) {
  Process load("needlelab-load",
               {"--stations", "8", "--viewers", "2", "--seconds", "3", "--seed", "5", "--json",
                folder_.path() / "json"},
               folder_.path() / "said");
  ASSERT_TRUE(streams(load)) << load.said();
  std::this_thread::sleep_for(1s);
  const pid_t server = childOf(load.pid());
  ASSERT_GT(server, 0);
  ASSERT_EQ(::kill(server, SIGSTOP), 0);
  std::this_thread::sleep_for(800ms);
  ASSERT_EQ(::kill(server, SIGCONT), 0);
  ASSERT_EQ(load.wait(), 0) << load.said();

  const auto result = json();
  for (const char* key : {"stations", "viewers", "seconds", "samples_sent", "samples_acked", "samples_stored",
                          "lost", "duplicated", "live_p50_ms", "live_p99_ms", "live_dropped_frames",
                          "ack_p99_ms", "server_cpu_s", "generator_cpu_s", "bytes_per_sample"})
    EXPECT_TRUE(result.contains(key)) << key;
  for (const char* key : {"samples_sent", "samples_acked", "samples_stored"})
    EXPECT_EQ(result[key], 24'000) << key;
  for (const char* key : {"lost", "duplicated", "different", "foreign", "live_corrupt"})
    EXPECT_EQ(result[key], 0) << key;
  // every station makes a chunk each second, so some were due while the server was down: a pause of the
  // generator cannot hide it. The same holds for frames, which the queues drop or deliver late.
  EXPECT_GT(result["ack_max_ms"], 300);
  EXPECT_TRUE(result["live_max_ms"] > 300 || result["live_dropped_frames"] > 8 * 10) << result;
  EXPECT_EQ(result["live_frames_sent"], 8 * 150);
  EXPECT_GT(result["server_cpu_s"], 0);
  EXPECT_GT(result["generator_cpu_s"], 0);
}

TEST_F(LoadProgram, anInterruptedRunEndsInOrder) {
  Process load("needlelab-load",
               {"--stations", "4", "--viewers", "1", "--seconds", "100", "--json", folder_.path() / "json"},
               folder_.path() / "said");
  ASSERT_TRUE(streams(load)) << load.said();
  std::this_thread::sleep_for(300ms);
  load.signal(SIGINT);
  ASSERT_EQ(load.wait(), 0) << load.said();
  const auto result = json();
  EXPECT_TRUE(result["interrupted"]);
  EXPECT_GT(result["samples_stored"], 0);
  EXPECT_EQ(result["samples_stored"], result["samples_made"]);
  EXPECT_EQ(result["sessions_closed"], 4);
}

TEST_F(LoadProgram, wrongUsageIsNamed) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"--stations", "0"}, "--stations: 0 is out of range"},
      {{"--stations", "many"}, "--stations"},
      {{"--server", "nowhere:port"}, "nowhere:port"},
      {{"--json", folder_.path() / "no" / "such" / "folder.json"}, "--json"},
      {{"--servers", "a,b", "--store", "postgresql:///x", "--out", folder_.path() / "soak"}, "--out"},
      {{"--no-such-option"}, "--no-such-option"},
      {{"--server", "127.0.0.1:1", "--ca", "/nowhere/ca.crt", "--password-file", "/nowhere/p"}, "/nowhere"},
  };
  for (const auto& [arguments, words] : cases) {
    EXPECT_EQ(run(arguments), 2) << arguments[0];
    EXPECT_NE(said_.find(words), std::string::npos) << said_;
  }
}

LoadOptions smallRun(std::size_t stations, double seconds) {
  LoadOptions options;
  options.stations = stations;
  options.viewers = 2;
  options.seconds = seconds;
  options.gestures = 4;
  options.bin = NEEDLELAB_BIN;
  options.quiet = true;
  return options;
}

// also on PostgreSQL
TEST(LoadRun, faultsLoseNothing) {
  const TempFolder folder;
  const PostgresBelow given_back{folder.path()};
  LoadOptions options = smallRun(10, 7);
  if (onPostgres()) options.store = postgresUrlOf(folder.path());
  options.faults = true;
  options.fault_every_s = 1.5;
  if (const char* seed = std::getenv("NEEDLELAB_SEED")) options.seed = std::strtoull(seed, nullptr, 10);
  RecordProperty("seed", std::to_string(options.seed));
  const std::atomic<bool> interrupt{false};
  const auto result = runLoad(options, interrupt);
  ASSERT_TRUE(result.ok()) << result.error().message;
  std::string words;
  for (const auto* list : {&result->stored.faults, &result->troubles})
    for (const std::string& text : *list) words += text + "\n";
  EXPECT_TRUE(result->good()) << "seed " << options.seed << "\n" << words;
  EXPECT_EQ(result->stored.samples.stored, 70'000u);
  EXPECT_GT(result->cuts, 0u);
  EXPECT_GT(result->kills, 0u);
  EXPECT_GT(result->stations.connections, 10u);
  if (!onPostgres()) return;
  const auto postgres = std::find_if(result->processes.begin(), result->processes.end(),
                                     [](const ProcessUse& use) { return use.name == "PostgreSQL"; });
  ASSERT_NE(postgres, result->processes.end());
  EXPECT_GT(postgres->cpu_s.value_or(0), 0);
  // all chunks go through its log
  EXPECT_GT(postgres->log_bytes.value_or(0), result->stored.chunk_bytes);
  EXPECT_GT(result->database_bytes, result->stored.chunk_bytes);
  // the database is no longer new
  const auto again = runLoad(options, interrupt);
  ASSERT_FALSE(again.ok());
  EXPECT_EQ(again.error().code, ErrorCode::kInvalidInput);
  EXPECT_NE(again.error().message.find("in use by a lab"), std::string::npos) << again.error().message;
}

// only on PostgreSQL: two servers and NATS, each with half of the stations; a viewer at one sees the stations
// of both
TEST(LoadRun, twoServersLoseNothing) {
  const TempFolder folder;
  const PostgresBelow given_back{folder.path()};
  LoadOptions options = smallRun(8, 4);
  options.servers = {"a", "b"};
  const std::atomic<bool> interrupt{false};
  if (!onPostgres()) {
    const auto refused = runLoad(options, interrupt);
    ASSERT_FALSE(refused.ok());
    EXPECT_NE(refused.error().message.find("--store"), std::string::npos) << refused.error().message;
    return;
  }
  options.store = postgresUrlOf(folder.path());
  const auto result = runLoad(options, interrupt);
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_TRUE(result->good()) << loadText(*result);
  EXPECT_EQ(result->stored.samples.stored, 32'000u);
  EXPECT_EQ(result->stations_at, (std::vector<std::size_t>{4, 4}));
  EXPECT_EQ(result->viewers.connections, 2u);
  // 50 per second from each; those of four stations come from the other server, through NATS
  EXPECT_EQ(result->stations.live_frames, 1600u);
  EXPECT_EQ(result->viewers.frames, 1600u);
  EXPECT_EQ(result->viewers.elsewhere.total(), 800u);

  std::vector<std::string> names;
  for (const ProcessUse& use : result->processes) {
    names.push_back(use.name);
    EXPECT_TRUE(use.cpu_s) << use.name;
  }
  ASSERT_EQ(names, (std::vector<std::string>{"server a", "server b", "PostgreSQL", "NATS", "generator"}));
  for (std::size_t i = 0; i < 2; ++i) {
    const ProcessUse& server = result->processes[i];
    // chunks and frames of four stations; frames of two more over NATS
    EXPECT_GE(server.messages_in.value_or(0), 4 * 4 + 4 * 200 + 2 * 200u) << server.name;
    EXPECT_GE(server.messages_out.value_or(0), 4 + 6 * 200u) << server.name;
    EXPECT_GT(server.received_bytes.value_or(0), result->stations.chunk_bytes / 2) << server.name;
  }
  EXPECT_GT(result->processes[2].log_bytes.value_or(0), result->stored.chunk_bytes);
  // the frames of four stations, and the servers' status of all eight
  const ProcessUse& nats = result->processes[3];
  EXPECT_GT(nats.messages_in.value_or(0), 800u);
  EXPECT_GT(nats.messages_out.value_or(0), 800u);
  EXPECT_GT(nats.sent_bytes.value_or(0), 0u);
}

// a server not started by the run: the run enrols stations and reads samples through it
TEST(LoadRun, worksOnAServerThatRunsAlready) {
  const TempFolder folder;
  const auto enrolled = enrol(folder.path() / "data", 0);
  ASSERT_TRUE(enrolled.ok()) << enrolled.error().message;
  folder.write("password", enrolled->password + "\n");
  OwnServer server(std::string(NEEDLELAB_BIN) + "/needlelab-server", folder.path());
  ASSERT_TRUE(server.start().ok());
  LoadOptions options = smallRun(3, 1.5);
  options.server = {Endpoint{"127.0.0.1", server.port()}};
  options.ca_file = server.caFile();
  options.password_file = folder.path() / "password";
  const std::atomic<bool> interrupt{false};
  const auto result = runLoad(options, interrupt);
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_TRUE(result->good());
  EXPECT_EQ(result->stored.samples.stored, 4'500u);
}

// planted faults in the database
class PlantedDatabase : public testing::Test {
 protected:
  PlantedDatabase() {
    shared_.pool = &pool_;
    shared_.ticks = 2000;
    shared_.stations = std::vector<StationPlan>(2);
    auto enrolled = enrol(folder_.path(), 2).value();
    connection_ =
        std::make_unique<Connection>(Connection::open(file(), {.mode = Connection::Mode::kWriter}).value());
    for (std::size_t i = 0; i < 2; ++i) {
      shared_.stations[i].name = enrolled.stations[i].first;
      shared_.stations[i].session = makeUuidV7();
      store(i);
    }
  }
  [[nodiscard]] std::filesystem::path file() const { return folder_.path() / "needlelab.db"; }

  Bytes chunkOf(std::size_t station, std::uint64_t seq) const {
    std::vector<GestureSample> samples(1000);
    StationStream(pool_, shared_.seed, station).fill(1000 * seq, samples);
    return encodeChunk(Resolution::standard(), samples);
  }
  void store(std::size_t station) {
    StationPlan& plan = shared_.stations[station];
    const std::string id(plan.session.begin(), plan.session.end());
    pb::SessionDescription d;
    d.set_session_id(id);
    d.set_station(plan.name);
    d.set_trainee("load");
    d.set_profile_id("p");
    d.set_profile_json("{}");
    d.set_engine_version("test");
    d.set_rate_hz(1000);
    d.set_started_unix_ns(1);
    SessionStore sessions(*connection_);
    ASSERT_TRUE(sessions.open(d, 1).ok());
    SessionHash hash;
    for (std::uint64_t seq = 0; seq < 2; ++seq) {
      const Bytes bytes = chunkOf(station, seq);
      hash.update(bytes);
      ASSERT_TRUE(sessions.append(plan.session, seq, bytes)->taken());
    }
    pb::CloseSession close;
    const Digest digest = hash.digest();
    close.set_session_id(id);
    close.set_chunks(2);
    close.set_samples(2000);
    close.set_hash(digest.data(), digest.size());
    ASSERT_TRUE(sessions.close(close, 2)->taken());
  }
  void sql(const std::string& text) {
    const Status done = connection_->script(text);
    ASSERT_TRUE(done.ok()) << done.error().message;
  }
  [[nodiscard]] DatabaseCheck check() { return checkDatabase(file(), shared_, {2000, 2000}, {}).value(); }

  GesturePool pool_ = makeGesturePool(1, 2).value();
  TempFolder folder_;
  LoadShared shared_;
  std::unique_ptr<Connection> connection_;
};

TEST_F(PlantedDatabase, isFoundOrClean) {
  struct Counts {
    std::uint64_t lost = 0, duplicated = 0, foreign = 0, not_complete = 0, stray = 0;
    bool operator==(const Counts&) const = default;
  };
  const struct {
    const char *what, *plant, *undo;
    Counts counts;
  } cases[] = {
      {"untouched", "", "", {}},
      {"open",
       "UPDATE sessions SET state = 1 WHERE number = 1",
       "UPDATE sessions SET state = 2 WHERE number = 1",
       {.not_complete = 1}},
      {"stored twice",
       "INSERT INTO chunks SELECT session, 2, samples, crc, bytes FROM chunks WHERE session = 1 AND seq = 1",
       "DELETE FROM chunks WHERE session = 1 AND seq = 2",
       {.duplicated = 1000}},
      {"damaged",
       "CREATE TABLE kept AS SELECT * FROM chunks; UPDATE chunks SET bytes = CAST(substr(bytes, 1, 200) || "
       "x'00' "
       "|| substr(bytes, 202) AS BLOB) WHERE session = 2 AND seq = 0",
       "",
       {.lost = 1000}},
      {"of another station",
       "UPDATE chunks SET bytes = (SELECT bytes FROM kept WHERE session = 1 AND seq = 0) WHERE session = 2 "
       "AND seq "
       "= 0",
       "UPDATE chunks SET bytes = (SELECT bytes FROM kept WHERE session = 2 AND seq = 0) WHERE session = 2 "
       "AND seq "
       "= 0",
       {.lost = 1000, .foreign = 1000}},
      {"a chunk is missing", "DELETE FROM chunks WHERE seq = 1 AND session = 1", "", {.lost = 1000}},
      {"a strange session",
       "UPDATE sessions SET id = randomblob(16) WHERE number = 2",
       "",
       {.lost = 3000, .stray = 1}},
  };
  for (const auto& planted : cases) {
    SCOPED_TRACE(planted.what);
    sql(planted.plant);
    const DatabaseCheck all = check();
    EXPECT_EQ(all.clean(), planted.counts == Counts{}) << (all.faults.empty() ? "" : all.faults[0]);
    EXPECT_TRUE((Counts{all.samples.lost, all.samples.duplicated, all.samples.foreign, all.not_complete,
                        all.stray}) == planted.counts)
        << all.samples.lost << " lost, " << all.samples.duplicated << " doubled, " << all.samples.foreign
        << " foreign, " << all.not_complete << " not complete, " << all.stray << " stray";
    sql(planted.undo);
  }
}

}  // namespace
}  // namespace needlelab::test
