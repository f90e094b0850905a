// Two servers of users' programs on one NATS. Each has a folder of its own: they share only the live
// plane.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "client/net/link/blocking_client.h"
#include "common/base/files/files.h"
#include "common/wire/asio.h"
#include "common/wire/certificates.h"
#include "tests/integration/lab.h"
#include "tests/nats/nats_server.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// deploy/faculty/nats-server.conf with what it marks CHANGE changed.
std::string facultyConfig(const TlsFiles& files) {
  std::string text = readWholeFile(NEEDLELAB_SOURCE "/deploy/faculty/nats-server.conf").value();
  for (const auto& [was, now] : {std::pair<std::string, std::string>("/etc/nats/nats.crt", files.certificate),
                                 {"/etc/nats/nats.key", files.key},
                                 {"CHANGE-a", "secret-of-a"},
                                 {"CHANGE-b", "secret-of-b"}}) {
    const auto at = text.find(was);
    if (at == std::string::npos) throw std::runtime_error("nats-server.conf has no " + was);
    text.replace(at, was.size(), now);
  }
  return text;
}

TlsFiles natsTls(const TempFolder& folder) {
  const auto files = tlsFilesIn(folder.path() / "tls");
  if (const auto made = ensureTlsFiles(files, {.hosts = {"127.0.0.1"}}); !made.ok())
    throw std::runtime_error(made.error().message);
  return files;
}

const std::vector<std::string> kLongLesson = {
    "--exercise", "ball-free-practice", "--device", "simulated", "--hand-repeat", "0", "--seconds", "600"};

/// What GET says at a server's --metrics.
std::string httpGet(const Lab& lab, const std::string& path) {
  const auto port = readWholeFile(lab.path("metrics"));
  if (!port.ok()) return {};
  asio::io_context io;
  Tcp::socket socket(io);
  boost::system::error_code error;
  socket.connect({asio::ip::make_address("127.0.0.1"), static_cast<std::uint16_t>(std::stoi(*port))}, error);
  asio::write(socket, asio::buffer("GET " + path + " HTTP/1.1\r\nHost: a\r\n\r\n"), error);
  std::string answer;
  for (std::array<char, 4096> piece{}; !error;)
    answer.append(piece.data(), socket.read_some(asio::buffer(piece), error));
  return answer;
}

class TwoServers : public testing::Test {
 protected:
  TwoServers() {
    nats.start();
    for (const auto& [lab, name] : {std::pair(&a, std::string("a")), std::pair(&b, std::string("b"))}) {
      const auto file =
          keys.write("user-" + name, "user = server-" + name + "\npassword = secret-of-" + name + "\n");
      std::filesystem::permissions(file, std::filesystem::perms(0600));
      lab->server_arguments = {"--live",
                               nats.url("tls"),
                               "--live-ca",
                               tls.ca_certificate,
                               "--live-user",
                               file,
                               "--live-name",
                               "server-" + name,
                               "--live-lab",
                               "faculty",
                               "--metrics",
                               "0",
                               "--metrics-port-file",
                               lab->path("metrics"),
                               "--web",
                               "off"};
      lab->startServer();
    }
  }
  /// The next message that fits.
  template <typename Fits>
  static std::optional<pb::Envelope> waitFor(BlockingClient& client, Fits fits) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (std::chrono::steady_clock::now() < end) {
      auto got = client.receive(100ms);
      if (got.ok() && fits(*got)) return std::move(*got);
      if (!got.ok() && got.error().code != ErrorCode::kNotFound) {
        ADD_FAILURE() << got.error().message;
        return std::nullopt;
      }
    }
    return std::nullopt;
  }
  static void subscribe(BlockingClient& client, std::uint32_t number, const std::string& station) {
    pb::Envelope envelope;
    envelope.mutable_subscribe()->set_subscription(number);
    envelope.mutable_subscribe()->set_station(station);
    ASSERT_TRUE(client.send(envelope).ok());
  }
  static bool isFrame(const pb::Envelope& envelope) { return envelope.has_live_frame(); }

  TempFolder keys;
  const TlsFiles tls = natsTls(keys);
  NatsServerProcess nats{facultyConfig(tls)};
  Lab a, b;
};

TEST_F(TwoServers, anInstructorWatchesAndStopsRemotelyAcrossANatsOutage) {
  const auto station = a.startStation("lesson", kLongLesson);
  auto ines = b.instructor();
  ASSERT_TRUE(ines.ok()) << ines.error().message;
  subscribe(*ines, 1, "station-1");
  const auto frame = waitFor(*ines, isFrame);
  ASSERT_TRUE(frame) << nats.said();
  EXPECT_EQ(frame->live_frame().station(), "station-1");
  EXPECT_FALSE(frame->live_frame().data().empty());

  pb::Request list;
  list.mutable_list_stations();
  ASSERT_TRUE(eventually([&] {
    const auto listed = ines->call(list);
    return listed.ok() && listed->stations().stations_size() == 1 &&
           listed->stations().stations(0).online() &&
           listed->stations().stations(0).status().trainee() == "tom" &&
           listed->stations().stations(0).status().server() == "server-a";
  }));
  EXPECT_THAT(httpGet(b, "/healthz"), HasSubstr("\"live_between_servers\":\"up\""));
  EXPECT_THAT(httpGet(b, "/healthz"), HasSubstr("\"live_servers\":[\"server-a\"]"));
  EXPECT_THAT(httpGet(b, "/metrics"), HasSubstr("needlelab_stations_elsewhere 1"));

  Process admin(
      "needlelab-admin",
      {"--server", "127.0.0.1:" + std::to_string(b.port()), "--ca", b.path("data") / "tls" / "ca.crt",
       "--user", "ines", "--password-file", b.path("password"), "station", "list"},
      b.path("list.log"));
  EXPECT_EQ(admin.wait(kPatience), 0);
  EXPECT_THAT(admin.said(), AllOf(HasSubstr("SERVER"), HasSubstr("server-a")));

  nats.kill();
  const auto told =
      waitFor(*ines, [](const pb::Envelope& each) { return !each.station_status().trouble().empty(); });
  ASSERT_TRUE(told);
  EXPECT_EQ(told->station_status().trouble(), "the live connection between servers is down");
  const std::string health = httpGet(b, "/healthz");
  EXPECT_THAT(health, HasSubstr("200 OK")) << "nothing that is stored needs it";
  EXPECT_THAT(health, HasSubstr("the live connection between servers is down"));
  pb::Request stop;
  stop.mutable_stop_lesson()->set_station("station-1");
  stop.mutable_stop_lesson()->set_reason("enough for today");
  const auto refused = ines->call(stop);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr("nothing was sent"));
  EXPECT_FALSE(station->wait(0ms)) << "the lesson continues";

  nats.start();
  ASSERT_TRUE(waitFor(*ines, isFrame)) << "by itself";
  const auto stopped = ines->call(stop);
  ASSERT_TRUE(stopped.ok()) << stopped.error().message;
  EXPECT_EQ(station->wait(kPatience), 0) << station->said();
  EXPECT_THAT(station->said(), HasSubstr("enough for today"));
  EXPECT_EQ(a.sessions().size(), 1u);

  // the line of the audit log is where it was asked, as is what did not arrive
  EXPECT_EQ(a.stopServer(), 0);
  EXPECT_EQ(b.stopServer(), 0);
  ASSERT_EQ(a.admin({"audit"}), 0);
  ASSERT_EQ(b.admin({"audit"}), 0);
  const auto linesOf = [](const Lab& lab) { return readWholeFile(lab.path("admin.log")).value(); };
  EXPECT_THAT(linesOf(b), HasSubstr("enough for today"));
  EXPECT_THAT(linesOf(b), HasSubstr("not delivered"));
  EXPECT_THAT(linesOf(a), Not(HasSubstr("enough for today")));
  for (const Lab* const lab : {&a, &b}) {
    const std::string log = readWholeFile(lab->path("server.log")).value();
    EXPECT_THAT(log, HasSubstr("live_link"));
    EXPECT_THAT(log, Not(HasSubstr("secret-of"))) << "no password in the log";
    EXPECT_THAT(log, Not(HasSubstr("live_refused"))) << "the permissions are enough";
  }
}

TEST_F(TwoServers, stationsOfAKilledServerGoOfflineAndReturnWithIt) {
  const auto station = a.startStation("lesson", kLongLesson);
  auto ines = b.instructor();
  ASSERT_TRUE(ines.ok()) << ines.error().message;
  subscribe(*ines, 1, "station-1");
  ASSERT_TRUE(waitFor(*ines, isFrame)) << nats.said();
  a.killServer();
  ASSERT_TRUE(waitFor(*ines, [](const pb::Envelope& each) {
    return each.has_station_status() && !each.station_status().online();
  }));
  a.startServer();
  ASSERT_TRUE(waitFor(*ines, isFrame));
  EXPECT_FALSE(station->wait(0ms));
}

}  // namespace
}  // namespace needlelab::test
