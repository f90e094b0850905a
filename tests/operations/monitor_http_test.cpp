// The HTTP server for monitoring: its resources are bounded, and it offers only the intended paths.
#include <gmock/gmock.h>

#include <dlfcn.h>
#include <sqlite3.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <atomic>
#include <future>
#include <nlohmann/json.hpp>

#include "server/live/monitor/monitor.h"
#include "tests/operations/prometheus_text.h"
#include "tests/unit/server/live/running_server.h"

namespace {

std::atomic<bool> hangs = false;

/// While this object lives, or until `hangs` is false, queries of the free disk space block.
struct HangingDisk {
  HangingDisk() { hangs = true; }
  ~HangingDisk() { hangs = false; }
  HangingDisk(const HangingDisk&) = delete;
  HangingDisk& operator=(const HangingDisk&) = delete;
};

}  // namespace

/// Replaces the C library's function in this program; std::filesystem::space calls it.
extern "C" int statvfs(const char* path, struct statvfs* facts) noexcept {
  using Real = int (*)(const char*, struct statvfs*);
  static const auto real = reinterpret_cast<Real>(::dlsym(RTLD_NEXT, "statvfs"));
  while (hangs) ::usleep(10'000);
  return real(path, facts);
}

namespace needlelab {
namespace {

using namespace test;

void withMetrics(ServerOptions& options) {
  options.metrics = "0";  // port only: any free port of this machine
}

TEST(Prometheus, labelsAreEscapedAndNumbersWhole) {
  PrometheusText out;
  out.metric("a_total", "counter", "Back\\slash and\nline.");
  out.sample(1e15, {{"x", "a\"b\\c\nd"}});
  out.sample(0.1, {{"x", "e"}});
  EXPECT_EQ(out.text(),
            "# HELP a_total Back\\\\slash and\\nline.\n# TYPE a_total counter\n"
            "a_total{x=\"a\\\"b\\\\c\\nd\"} 1e+15\na_total{x=\"e\"} 0.1\n");
  EXPECT_THAT(parsePrometheus(out.text()).faults, testing::IsEmpty());
}

TEST(Prometheus, theStrictReaderDetectsMalformedText) {
  for (const char* text :
       {"a 1", "a 1\n", "# HELP a x\n# TYPE a counter\na 1\n", "# HELP a x\n# TYPE a gauge\nb 1\n",
        "# HELP a x\n# TYPE a gauge\na 1\na 2\n", "# HELP a x\n# TYPE a gauge\na{b=c} 1\n",
        "# HELP a x\n# TYPE a gauge\na 1,5\n", "# TYPE a gauge\na 1\n",
        "# HELP h x\n# TYPE h histogram\nh_bucket{le=\"1\"} 2\nh_bucket{le=\"+Inf\"} 1\nh_sum 1\nh_count "
        "1\n"})
    EXPECT_THAT(parsePrometheus(text).faults, testing::Not(testing::IsEmpty())) << text;
}

TEST(MonitorHttp, answersGetAndHeadOfTwoPathsOnly) {
  RunningServer server(withMetrics);
  const std::uint16_t port = server.server().metricsPort();
  ASSERT_NE(port, 0);
  const HttpReply metrics = httpGet(port, "/metrics");
  EXPECT_EQ(metrics.status, 200);
  EXPECT_THAT(metrics.head, testing::HasSubstr("text/plain; version=0.0.4"));
  const Scrape scrape = parsePrometheus(metrics.body);
  EXPECT_THAT(scrape.faults, testing::IsEmpty());
  EXPECT_GT(scrape.types.size(), 40u);
  EXPECT_EQ(httpGet(port, "/metrics?x=1").status, 200);
  EXPECT_EQ(httpGet(port, "/").status, 404);
  EXPECT_EQ(httpGet(port, "/../etc/passwd").status, 404);
  EXPECT_EQ(httpSend(port, "POST /metrics HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\n\r\n").status, 405);
  const HttpReply head = httpSend(port, "HEAD /healthz HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_EQ(head.status, 200);
  EXPECT_TRUE(head.body.empty());
}

TEST(MonitorHttp, garbageAndGiantsEndBeforeTheirTimeAndTheNextIsServed) {
  RunningServer server([](ServerOptions& options) {
    withMetrics(options);
    options.monitor.connection_time = std::chrono::hours(1);
  });
  const std::uint16_t port = server.server().metricsPort();
  for (const std::string& bytes :
       {std::string("\x16\x03\x01\x02\x00\x01", 6) + std::string(300, 'x'), std::string(1u << 20, 'A'),
        "GET /metrics HTTP/1.1\r\nX: " + std::string(100'000, 'y') + "\r\n\r\n",
        std::string("GET /metrics HTTP/1.1\r\nContent-Length: 99999999\r\n\r\nabc")}) {
    const HttpReply reply = httpSend(port, bytes);
    EXPECT_TRUE(reply.ended);
    EXPECT_TRUE(reply.status == 0 || reply.status == 400 || reply.status == 200) << reply.head;
  }
  EXPECT_EQ(httpGet(port, "/healthz").status, 200);
  EXPECT_EQ(server.stop(), 0);
}

TEST(Health, anIdleServerProvesThatItCanWrite) {
  RunningServer server(withMetrics);
  const auto commits = server.server().store().writer().counters().commits;
  const HttpReply reply = httpGet(server.server().metricsPort(), "/healthz");
  EXPECT_EQ(reply.status, 200) << reply.body;
  EXPECT_EQ(std::count(reply.body.begin(), reply.body.end(), '\n'), 1) << "one line";
  const auto json = nlohmann::json::parse(reply.body, nullptr, false);
  ASSERT_TRUE(json.is_object()) << reply.body;
  EXPECT_EQ(json["healthy"], true);
  EXPECT_EQ(json["database_writable"], true);
  EXPECT_GT(json["disk_free_bytes"], 0);
  EXPECT_TRUE(json["backup_age_s"].is_null());
  EXPECT_GT(json["certificate_days_left"], 700);
  EXPECT_EQ(server.server().store().writer().counters().commits, commits + 1) << "the trial write";
  // A second request at once gets the cached answer: monitoring costs almost nothing.
  for (int i = 0; i < 5; ++i) EXPECT_EQ(httpGet(server.server().metricsPort(), "/healthz").status, 200);
  EXPECT_EQ(server.server().store().writer().counters().commits, commits + 1);
}

TEST(Health, aFullDiskAndAMissingBackupReturn503WithReasons) {
  RunningServer server([](ServerOptions& options) {
    withMetrics(options);
    options.monitor.min_free_bytes = std::uint64_t{1} << 60;
    options.monitor.max_backup_age = std::chrono::hours(24);
  });
  const HttpReply reply = httpGet(server.server().metricsPort(), "/healthz");
  EXPECT_EQ(reply.status, 503);
  EXPECT_THAT(reply.body,
              testing::AllOf(testing::HasSubstr("MiB left"), testing::HasSubstr("never a verified backup"),
                             testing::HasSubstr("\"healthy\":false")));
  EXPECT_EQ(server.server().store().writer().counters().commits, 0u)
      << "no trial write where there is no room";
}

// The finding: without a right to one table every chunk was refused, and a trial write to another one
// succeeded.
TEST(Health, whatCannotBeStoredIs503ThoughATrialWriteSucceeds) {
  RunningServer server(withMetrics);
  const std::uint16_t port = server.server().metricsPort();
  ASSERT_EQ(httpGet(port, "/healthz").status, 200);
  const Status failed = server.server().store().writer().run(
      [](Connection& connection) { return connection.run("INSERT INTO nowhere VALUES (1)"); });
  ASSERT_FALSE(failed.ok());
  const HttpReply reply = httpGet(port, "/healthz");
  EXPECT_EQ(reply.status, 503);
  const auto json = nlohmann::json::parse(reply.body);
  EXPECT_EQ(json["database_writable"], false);
  EXPECT_EQ(json["problems"], nlohmann::json::array({"not all is stored: " + failed.error().message}));
}

TEST(Health, aRefusingDatabaseIsReportedWithItsReasonAndRetried) {
  RunningServer server(withMetrics);
  const std::uint16_t port = server.server().metricsPort();
  DbWriter& writer = server.server().store().writer();
  ASSERT_TRUE(writer
                  .run([](Connection& connection) {
                    sqlite3_busy_timeout(connection.handle(), 10);
                    return Status();
                  })
                  .ok());
  ASSERT_EQ(httpGet(port, "/healthz").status, 200);
  auto shell = Connection::open(server.server().store().databasePath(), {.mode = Connection::Mode::kWriter});
  ASSERT_TRUE(shell.ok() && shell->script("BEGIN IMMEDIATE").ok());
  const Status refused = writer.run([](Connection&) { return Status(); });
  ASSERT_FALSE(refused.ok());
  const HttpReply reply = httpGet(port, "/healthz");
  EXPECT_EQ(reply.status, 503) << "a commit succeeded within the last 10 s, but none since";
  EXPECT_EQ(nlohmann::json::parse(reply.body)["problems"],
            nlohmann::json::array({"a trial write was not committed in time",
                                   "the last change was refused: " + refused.error().message}));
  ASSERT_TRUE(shell->script("ROLLBACK").ok());
  EXPECT_EQ(httpGet(port, "/healthz").status, 200) << "the trial write ends it";
}

TEST(Health, missingAcknowledgedDataIsReportedAndCounted) {
  const auto missing = [](const char* lack) {
    RunningServer server([&](ServerOptions& options) {
      withMetrics(options);
      options.writer.lack_at_start = lack;
    });
    const std::uint16_t port = server.server().metricsPort();
    const HttpReply health = httpGet(port, "/healthz");
    EXPECT_EQ(health.status, *lack == '\0' ? 200 : 503);
    EXPECT_THAT(health.body, testing::HasSubstr(lack));
    return parsePrometheus(httpGet(port, "/metrics").body)["needlelab_acknowledged_missing"];
  };
  EXPECT_EQ(missing(""), 0);
  EXPECT_EQ(missing("transaction 7 is unknown here"), 1);
}

TEST(Health, aHangingDiskIsReportedWithoutWaitingForIt) {
  RunningServer server([](ServerOptions& options) {
    withMetrics(options);
    options.monitor.read_patience = milliseconds(300);
  });
  const std::uint16_t port = server.server().metricsPort();
  ASSERT_EQ(httpGet(port, "/healthz").status, 200);
  const auto gauge = [](const HttpReply& reply, const std::string& name) {
    const std::size_t at = reply.body.find("\n" + name + " ");
    return at == std::string::npos ? std::string("none")
                                   : reply.body.substr(at + name.size() + 2,
                                                       reply.body.find('\n', at + 1) - at - name.size() - 2);
  };
  ASSERT_EQ(gauge(httpGet(port, "/metrics"), "needlelab_database_readable"), "1");
  const HangingDisk disk;
  const auto becomes = [&](int status) {  // values are cached for one second
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
    HttpReply reply = httpGet(port, "/healthz");
    while (reply.status != status && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(milliseconds(50));
      reply = httpGet(port, "/healthz");
    }
    return reply;
  };
  ASSERT_EQ(becomes(503).status, 503);
  // Several requests at once, repeated: each gets an answer while the disk hangs.
  for (int round = 0; round < 2; ++round) {
    std::vector<std::future<HttpReply>> asked;
    for (int i = 0; i < 4; ++i)
      asked.push_back(std::async(std::launch::async, [&] { return httpGet(port, "/healthz"); }));
    for (auto& each : asked) {
      const HttpReply reply = each.get();
      EXPECT_EQ(reply.status, 503);
      EXPECT_THAT(reply.body, testing::AllOf(testing::HasSubstr("the disk does not answer"),
                                             testing::HasSubstr("\"healthy\":false")));
    }
  }
  const HttpReply metrics = httpGet(port, "/metrics");
  EXPECT_EQ(metrics.status, 200);
  EXPECT_THAT(parsePrometheus(metrics.body).faults, testing::IsEmpty());
  EXPECT_EQ(gauge(metrics, "needlelab_database_readable"), "0");
  EXPECT_NE(gauge(metrics, "needlelab_disk_size_bytes"), "0") << "what was known stays";
  hangs = false;  // the disk works again
  const HttpReply again = becomes(200);
  EXPECT_EQ(again.status, 200) << again.body;
}

}  // namespace
}  // namespace needlelab
