// The carrier over a real nats-server.
#include "server/nats/nats_carrier.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "common/wire/certificates.h"
#include "server/base/log.h"
#include "tests/nats/nats_server.h"

namespace needlelab {
namespace {

using namespace std::chrono_literals;
using test::NatsServerProcess;
using test::TempFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// Runs the network's thread for a while.
template <typename Condition>
bool runUntil(asio::io_context& io, Condition holds, std::chrono::milliseconds limit = test::kPatience) {
  const auto end = std::chrono::steady_clock::now() + limit;
  while (!holds()) {
    if (std::chrono::steady_clock::now() >= end) return false;
    io.restart();
    io.run_for(5ms);
  }
  return true;
}

struct Heard : LiveCarrier::Listener {
  void onMessage(LivePlane plane, const std::string& name, std::string_view message) override {
    messages.emplace_back(plane, name, std::string(message));
  }
  void onLink(bool is_up, const std::string& reason) override {
    up = is_up;
    why = reason;
    ++changes;
  }
  std::vector<std::tuple<LivePlane, std::string, std::string>> messages;
  bool up = false;
  std::string why;
  int changes = 0;
};

/// A server's end.
struct End {
  End(asio::io_context& io, NatsSettings settings, const std::string& lab, const std::string& name) {
    auto made = NatsCarrier::make(io.get_executor(), std::move(settings));
    if (!made.ok()) throw std::runtime_error(made.error().message);
    carrier = std::move(*made);
    carrier->start(heard, lab, name);
  }
  ~End() { carrier->stop(); }
  End(const End&) = delete;
  End& operator=(const End&) = delete;
  Heard heard;
  std::unique_ptr<NatsCarrier> carrier;
};

class NatsCarrierTest : public testing::Test {
 protected:
  NatsCarrierTest() { setLogLevel(LogLevel::kOff); }
  std::unique_ptr<End> join(const std::string& name, const std::string& lab = "lab 1") {
    return std::make_unique<End>(io, NatsSettings{.address = nats.url()}, lab, name);
  }
  bool bothUp(const End& one, const End& other) {
    return runUntil(io, [&] { return one.heard.up && other.heard.up; });
  }

  asio::io_context io{1};
  NatsServerProcess nats;
};

TEST_F(NatsCarrierTest, bringsEachPlaneToItsSubscribers) {
  nats.start();
  const auto a = join("a"), b = join("b"), foreign = join("a", "lab 2");
  ASSERT_TRUE(bothUp(*a, *b) && bothUp(*a, *foreign));
  a->carrier->publish(LivePlane::kPresence, "a", "here");
  a->carrier->publish(LivePlane::kWatch, "bench 1.x", "watched");
  a->carrier->publish(LivePlane::kAsk, "bänk*>", std::string("\0\n\xff", 3));
  a->carrier->publish(LivePlane::kAnswer, "c", "not for b");
  a->carrier->publish(LivePlane::kLive, "bench-1", "no one wants it");
  a->carrier->publish(LivePlane::kAnswer, "b", "done");
  ASSERT_TRUE(runUntil(io, [&] { return b->heard.messages.size() >= 4; })) << nats.said();
  EXPECT_THAT(b->heard.messages,
              ElementsAre(std::tuple(LivePlane::kPresence, "a", "here"),
                          std::tuple(LivePlane::kWatch, "bench 1.x", "watched"),
                          std::tuple(LivePlane::kAsk, "bänk*>", std::string("\0\n\xff", 3)),
                          std::tuple(LivePlane::kAnswer, "b", "done")));
  b->carrier->listenTo("bench-1", true);
  b->heard.messages.clear();
  // until its subscription is at the server
  ASSERT_TRUE(runUntil(io, [&] {
    a->carrier->publish(LivePlane::kLive, "bench-1", "frame");
    return !b->heard.messages.empty();
  }));
  EXPECT_EQ(b->heard.messages.front(), std::tuple(LivePlane::kLive, "bench-1", "frame"));
  EXPECT_THAT(a->heard.messages, IsEmpty()) << "nothing of its own";
  EXPECT_THAT(foreign->heard.messages, IsEmpty()) << "nothing of another lab";
  b->carrier->listenTo("bench-1", false);
  ASSERT_TRUE(runUntil(io, [&] {
    const auto before = b->heard.messages.size();
    a->carrier->publish(LivePlane::kLive, "bench-1", "frame");
    (void)runUntil(
        io, [] { return false; }, 30ms);
    return b->heard.messages.size() == before;
  }));
  const auto counted = a->carrier->counters();
  EXPECT_TRUE(counted.connected);
  EXPECT_GT(counted.messages_out, 6u);
  EXPECT_EQ(counted.malformed + counted.refused, 0u);
}

TEST_F(NatsCarrierTest, longMessagesPassAndLongerOnesDoNot) {
  nats.start();
  const auto a = join("a"), b = join("b");
  ASSERT_TRUE(bothUp(*a, *b));
  const std::string most(LiveCarrier::kMostBytes, 'x');
  a->carrier->publish(LivePlane::kPresence, "a", most + "x");
  a->carrier->publish(LivePlane::kPresence, "a", most);
  ASSERT_TRUE(runUntil(io, [&] { return !b->heard.messages.empty(); }));
  EXPECT_EQ(std::get<2>(b->heard.messages.front()), most);
  EXPECT_EQ(a->carrier->counters().dropped_out, 1u);
}

TEST_F(NatsCarrierTest, comesBackByItselfWhenNatsWasKilled) {
  nats.start();
  const auto a = join("a"), b = join("b");
  ASSERT_TRUE(bothUp(*a, *b));
  b->carrier->listenTo("bench-1", true);
  for (int kills = 0; kills < 3; ++kills) {
    nats.kill();
    ASSERT_TRUE(runUntil(io, [&] { return !a->heard.up && !b->heard.up; }));
    EXPECT_THAT(a->heard.why, Not(IsEmpty()));
    a->carrier->publish(LivePlane::kPresence, "a", "lost");
    nats.start();
    ASSERT_TRUE(bothUp(*a, *b)) << nats.said();
    a->heard.messages.clear();
    b->heard.messages.clear();
    a->carrier->publish(LivePlane::kPresence, "a", "again");
    a->carrier->publish(LivePlane::kLive, "bench-1", "frame");
    ASSERT_TRUE(runUntil(io, [&] { return b->heard.messages.size() >= 2; }));
    EXPECT_THAT(b->heard.messages, ElementsAre(std::tuple(LivePlane::kPresence, "a", "again"),
                                               std::tuple(LivePlane::kLive, "bench-1", "frame")))
        << "nothing old, and what was listened to still is";
  }
  EXPECT_EQ(a->carrier->counters().connections, 4u);
  EXPECT_EQ(a->carrier->counters().dropped_out, 3u);
}

TEST_F(NatsCarrierTest, startsWithoutNatsAndFindsItLater) {
  nats.start();
  nats.kill();  // its port is known
  const auto a = join("a");
  ASSERT_TRUE(runUntil(io, [&] { return a->heard.changes > 0; }));
  EXPECT_FALSE(a->heard.up);
  EXPECT_THAT(a->heard.why, HasSubstr(nats.url()));
  nats.start();
  EXPECT_TRUE(runUntil(io, [&] { return a->heard.up; }));
}

TEST_F(NatsCarrierTest, noticesANatsThatHangsAndNeverWaitsForIt) {
  nats.start();
  const auto a = join("a"), b = join("b");
  ASSERT_TRUE(bothUp(*a, *b));
  nats.signal(SIGSTOP);
  // more than all buffers on the way hold
  const std::string frame(1000, 'f');
  for (int i = 0; i < 100'000; ++i) a->carrier->publish(LivePlane::kLive, "bench-1", frame);
  EXPECT_GT(a->carrier->counters().dropped_out, 50'000u) << "the oldest";
  EXPECT_TRUE(runUntil(io, [&] { return !a->heard.up && !b->heard.up; }));
  nats.signal(SIGCONT);
  ASSERT_TRUE(bothUp(*a, *b));
  a->carrier->publish(LivePlane::kPresence, "a", "again");
  EXPECT_TRUE(runUntil(
      io, [&] { return !b->heard.messages.empty() && std::get<2>(b->heard.messages.back()) == "again"; }));
}

TEST_F(NatsCarrierTest, aReceiverThatIsSlowLosesTheOldest) {
  nats.start();
  const auto a = join("a");
  const auto b =
      std::make_unique<End>(io, NatsSettings{.address = nats.url(), .queued_items = 100}, "lab 1", "b");
  ASSERT_TRUE(bothUp(*a, *b));
  // its network's thread does something else meanwhile
  for (int i = 0; i < 1000; ++i) {
    a->carrier->publish(LivePlane::kPresence, "a", std::to_string(i));
    if (i % 50 == 49) std::this_thread::sleep_for(10ms);
  }
  ASSERT_TRUE(test::eventually([&] { return b->carrier->counters().messages_in == 1000; }));
  io.restart();
  io.poll();
  EXPECT_EQ(b->carrier->counters().dropped_in, 900u);
  ASSERT_EQ(b->heard.messages.size(), 100u);
  EXPECT_EQ(std::get<2>(b->heard.messages.back()), "999");
}

TEST_F(NatsCarrierTest, whatIsNoSubjectOfTheLabIsCounted) {
  nats.start();
  const auto a = join("a");
  ASSERT_TRUE(runUntil(io, [&] { return a->heard.up; }));
  // somebody else, on the same subjects
  asio::ip::tcp::socket other(io);
  other.connect({asio::ip::make_address("127.0.0.1"), static_cast<std::uint16_t>(nats.port())});
  const std::string lines =
      "CONNECT {\"verbose\":false}\r\n"
      "PUB nl.lab=201.presence.b=2 3\r\nxyz\r\n"
      "PUB nl.lab=201.ask.bench-1 5\r\nhello\r\n"
      "PING\r\n";
  asio::write(other, asio::buffer(lines));
  ASSERT_TRUE(runUntil(io, [&] { return !a->heard.messages.empty(); }));
  EXPECT_EQ(a->heard.messages.front(), std::tuple(LivePlane::kAsk, "bench-1", "hello"));
  EXPECT_EQ(a->carrier->counters().malformed, 1u);
}

constexpr const char* kUsers = R"(
authorization {
  users = [
    { user: a, password: "right one" }
    { user: b, password: "right two" }
  ]
}
)";

TEST_F(NatsCarrierTest, logsInWithTheUserOfAFile) {
  NatsServerProcess guarded(kUsers);
  guarded.start();
  auto& files = guarded.files();
  files.write("right", "user = a\npassword = right one\n");
  files.write("wrong", "user = a\npassword = guessed\n");
  for (const char* const name : {"right", "wrong"})
    std::filesystem::permissions(files.path() / name, std::filesystem::perms(0600));
  End right(io, {.address = guarded.url(), .user = files.path() / "right"}, "lab", "a");
  End wrong(io, {.address = guarded.url(), .user = files.path() / "wrong"}, "lab", "b");
  End none(io, {.address = guarded.url()}, "lab", "c");
  ASSERT_TRUE(
      runUntil(io, [&] { return right.heard.up && wrong.heard.changes > 0 && none.heard.changes > 0; }));
  for (const End* const refused : {&wrong, &none}) {
    EXPECT_FALSE(refused->heard.up);
    EXPECT_THAT(refused->heard.why, HasSubstr("Authentication"));
    EXPECT_THAT(refused->heard.why, Not(HasSubstr("guessed")));
  }
}

TEST_F(NatsCarrierTest, overTlsTrustsItsAuthorityAndTheHostsNameOnly) {
  TempFolder keys;
  const auto ours = tlsFilesIn(keys.path() / "ours"), others = tlsFilesIn(keys.path() / "others");
  ASSERT_TRUE(ensureTlsFiles(ours, {.hosts = {"127.0.0.1", "localhost"}}).ok());
  ASSERT_TRUE(ensureTlsFiles(others, {.hosts = {"10.1.2.3"}}).ok());
  const auto config = [](const TlsFiles& files) {
    return "tls { cert_file: \"" + files.certificate.string() + "\", key_file: \"" + files.key.string() +
           "\" }\n";
  };
  NatsServerProcess guarded(config(ours));
  guarded.start();
  End right(io, {.address = guarded.url("tls"), .ca = ours.ca_certificate}, "lab", "a");
  End wrong_authority(io, {.address = guarded.url("tls"), .ca = others.ca_certificate}, "lab", "b");
  End plain(io, {.address = guarded.url()}, "lab", "c");
  ASSERT_TRUE(runUntil(
      io, [&] { return right.heard.up && wrong_authority.heard.changes > 0 && plain.heard.changes > 0; }))
      << right.heard.why << guarded.said();
  EXPECT_FALSE(wrong_authority.heard.up);
  EXPECT_FALSE(plain.heard.up);
  EXPECT_THAT(wrong_authority.heard.why, HasSubstr("SSL"));

  // the right authority, and a certificate for another machine
  const auto elsewhere = tlsFilesIn(keys.path() / "elsewhere");
  std::filesystem::create_directories(keys.path() / "elsewhere");
  std::filesystem::copy(ours.ca_certificate, elsewhere.ca_certificate);
  std::filesystem::copy(ours.ca_key, elsewhere.ca_key);
  ASSERT_TRUE(ensureTlsFiles(elsewhere, {.hosts = {"10.1.2.3"}}).ok());
  NatsServerProcess impostor(config(elsewhere));
  impostor.start();
  End fooled(io, {.address = impostor.url("tls"), .ca = ours.ca_certificate}, "lab", "a");
  ASSERT_TRUE(runUntil(io, [&] { return fooled.heard.changes > 0; }));
  EXPECT_FALSE(fooled.heard.up) << impostor.said();
}

}  // namespace
}  // namespace needlelab
