// The counters add up after a real lesson: real server, real station, real instructor, real backup.
#include <gmock/gmock.h>

#include <cmath>
#include <ctime>

#include "common/base/files/files.h"
#include "tests/integration/lab.h"
#include "tests/operations/prometheus_text.h"
#include "tests/support/patience.h"
#include "tests/support/sanitized.h"

namespace needlelab {
namespace {

using namespace test;
using namespace std::chrono_literals;

TEST(Metrics, addUpAfterALesson) {
  Lab lab;
  lab.server_arguments = {"--metrics", "0", "--metrics-port-file", lab.path("metrics.port")};
  lab.startServer();
  const auto port = static_cast<std::uint16_t>(std::stoi(*readWholeFile(lab.path("metrics.port"))));
  const Scrape before = parsePrometheus(httpGet(port, "/metrics").body);
  ASSERT_THAT(before.faults, testing::IsEmpty());
  EXPECT_EQ(before["needlelab_chunks_total{result=\"stored\"}"], 0);
  if (!kSanitized) {  // a sanitizer's allocator counts nothing here
    EXPECT_GT(before["needlelab_heap_live_bytes"], 100'000);
    EXPECT_LT(before["needlelab_heap_live_bytes"], before["process_resident_memory_bytes"]);
  }

  auto station =
      lab.startStation("one", {"--exercise", "shoulder-bursa", "--device", "simulated", "--seconds", "2.5"});
  {
    auto viewer = lab.instructor();
    ASSERT_TRUE(viewer.ok());
    pb::Envelope subscribe;
    subscribe.mutable_subscribe()->set_subscription(1);
    subscribe.mutable_subscribe()->set_station("station-1");
    ASSERT_TRUE(viewer->send(subscribe).ok());
    std::uint64_t frames = 0;
    while (frames < 20) {
      auto got = viewer->receive(kPatience);
      ASSERT_TRUE(got.ok()) << got.error().message;
      if (got->has_live_frame()) ++frames;
    }
    // While it runs: the metrics count the station and the viewer in the right place (values from the
    // database are at most one second old).
    Scrape during;
    EXPECT_TRUE(eventually([&] {
      during = parsePrometheus(httpGet(port, "/metrics").body);
      return during["needlelab_sessions_open"] == 1;
    }));
    EXPECT_EQ(during["needlelab_connections{role=\"station\",state=\"in_session\"}"], 1);
    EXPECT_EQ(during["needlelab_connections{role=\"instructor\",state=\"authenticated\"}"], 1);
    EXPECT_EQ(during["needlelab_stations_online"], 1);
    EXPECT_GE(during["needlelab_live_frames_sent_total"], 20);
  }
  ASSERT_EQ(station->wait(), 0) << station->said();

  const auto summary = lab.summary("one");
  const auto sessions = lab.sessions();
  ASSERT_EQ(sessions.size(), 1u);
  Scrape after;
  // The shown values are at most one second old.
  ASSERT_TRUE(eventually([&] {
    after = parsePrometheus(httpGet(port, "/metrics").body);
    return after["needlelab_sessions_open"] == 0;
  }));
  EXPECT_THAT(after.faults, testing::IsEmpty());
  const double chunks = static_cast<double>(sessions[0].chunks());
  EXPECT_GE(chunks, 2);
  EXPECT_EQ(after["needlelab_chunks_total{result=\"stored\"}"], chunks);
  EXPECT_EQ(after["needlelab_chunks_total{result=\"repeated\"}"], 0);
  EXPECT_EQ(after["needlelab_chunks_total{result=\"refused\"}"], 0);
  EXPECT_EQ(after["needlelab_chunks_in_flight"], 0);
  EXPECT_EQ(after["needlelab_sessions_closed_total"], 1);
  EXPECT_EQ(after["needlelab_unsafe_chunks"], chunks) << "no backup yet";
  EXPECT_EQ(after["needlelab_clock_ahead"], 0);
  EXPECT_GE(after["needlelab_acks_total"], 2);
  // Every item was committed in exactly one group, and every group in one commit.
  EXPECT_EQ(after["needlelab_commit_group_items_sum"], after["needlelab_writer_items_total"]);
  EXPECT_EQ(after["needlelab_commit_group_items_count"], after["needlelab_commit_seconds_count"]);
  EXPECT_GE(after["needlelab_writer_items_total"], chunks + 2) << "chunks, open, close";
  // On SQLite chunks are stored one by one, and the writer waits for no server.
  for (const char* const name :
       {"needlelab_writer_chunks_together_total", "needlelab_writer_chunks_checked_ahead_total"}) {
    EXPECT_TRUE(after.samples.contains(name)) << name;
    EXPECT_EQ(after[name], 0) << name;
  }
  EXPECT_GT(after["needlelab_commit_seconds_sum"], 0);
  // All connections have ended, except the one of this request.
  EXPECT_EQ(after["needlelab_logins_total"] + after["needlelab_logins_refused_total"] +
                after["needlelab_handshakes_failed_total"],
            after["needlelab_connections_total"]);
  EXPECT_EQ(after["needlelab_logins_refused_total"], 0);
  EXPECT_EQ(after["needlelab_connections{role=\"station\",state=\"in_session\"}"], 0);
  EXPECT_GT(after["needlelab_received_bytes_total"], static_cast<double>(sessions[0].stored_bytes()));
  EXPECT_GE(after["needlelab_live_frames_received_total"], 20);
  EXPECT_GT(after["process_resident_memory_bytes"], 1e6);
  EXPECT_GT(after["process_cpu_seconds_total"], 0);
  EXPECT_NEAR(after["process_start_time_seconds"], static_cast<double>(std::time(nullptr)), 120);
  EXPECT_GT(after["process_max_fds"], after["process_open_fds"]);
  EXPECT_TRUE(std::isnan(after["needlelab_backup_age_seconds"])) << "there is none";
  // Counters never decrease.
  for (const auto& [name, value] : before.samples) {
    if (name.find("_total") != std::string::npos) {
      EXPECT_GE(after[name], value) << name;
    }
  }

  // A refused log-in is counted as refused.
  ClientConfig stranger;
  stranger.connect_timeout = kPatience;
  stranger.server.port = static_cast<std::uint16_t>(std::stoi(*readWholeFile(lab.path("port"))));
  stranger.ca_file = lab.path("data") / "tls" / "ca.crt";
  stranger.login = stationLogin("station-1", std::string(32, 'x'));
  EXPECT_FALSE(BlockingClient::connect(stranger).ok());
  EXPECT_EQ(parsePrometheus(httpGet(port, "/metrics").body)["needlelab_logins_refused_total"], 1);
  EXPECT_EQ(lab.stopServer(), 0);
}

}  // namespace
}  // namespace needlelab
