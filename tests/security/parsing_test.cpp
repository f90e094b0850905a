// A trainee sends requests that are small on the wire, large in memory, and not allowed for trainees: the
// server must refuse each by its first bytes, and continue with everyone else in the meantime.
#include <gtest/gtest.h>

#include <cstdio>
#include <memory>
#include <vector>

#include "server/live/monitor/monitor.h"
#include "tests/support/sanitized.h"
#include "tests/unit/server/live/raw_peer.h"

namespace needlelab::test {
namespace {

constexpr const char* kTheirPassword = "correct horse battery";
constexpr std::size_t kConnections = 8, kRounds = 4;
constexpr int kIds = 524'200;  // as many empty ones as fit in a message of 1 MiB

std::string referenceOfNothing(std::uint64_t id) {
  pb::Envelope envelope;
  envelope.mutable_request()->set_id(id);
  for (int i = 0; i < kIds; ++i) envelope.mutable_request()->mutable_set_reference()->add_session_ids();
  return RawPeer::framed(envelope);
}

TEST(Parsing, aTraineesForbiddenRequestsCostOthersNothing) {
  RunningServer server;
  server.addUser("tina", pb::TRAINEE, kTheirPassword);
  server.addUser("ines", pb::INSTRUCTOR, kTheirPassword);
  std::vector<std::unique_ptr<RawPeer>> attackers;
  for (std::size_t i = 0; i < kConnections; ++i) {
    attackers.push_back(std::make_unique<RawPeer>(server));
    ASSERT_TRUE(attackers.back()->logIn(personLogin("tina", kTheirPassword)).has_welcome());
  }
  RawPeer other(server);
  ASSERT_TRUE(other.logIn(personLogin("ines", kTheirPassword)).has_welcome());
  const std::string bytes = referenceOfNothing(1);
  ASSERT_GT(bytes.size(), 1'000'000u);
  const std::uint64_t before = processFacts().rss_bytes;
  std::uint64_t most = before;
  std::size_t refused = 0;
  for (std::size_t round = 0; round < kRounds; ++round) {
    for (auto& attacker : attackers) attacker->write(bytes);
    // No refusal has been read yet: the other's ping waits for none of them.
    pb::Envelope ping;
    ping.mutable_ping()->set_id(round + 1);
    other.send(ping);
    const auto pong = other.receive();
    ASSERT_TRUE(pong.has_value() && pong->has_pong());
    EXPECT_EQ(pong->pong().id(), round + 1);
    most = std::max<std::uint64_t>(most, processFacts().rss_bytes);
    for (auto& attacker : attackers) {
      const auto answer = attacker->receive();
      ASSERT_TRUE(answer.has_value() && answer->has_refusal());
      EXPECT_EQ(answer->refusal().reason(), pb::Refusal::ROLE) << answer->refusal().text();
      EXPECT_EQ(answer->refused_request(), 1u);
      ++refused;
    }
  }
  EXPECT_EQ(refused, kConnections * kRounds);
  EXPECT_EQ(server.stop(), 0);
  const ServerCounters& counters = server.counters();
  EXPECT_EQ(counters.messages_refused_unparsed, refused) << "every one by its first bytes";
  EXPECT_EQ(counters.messages_parsed, 2 * (kConnections + 1) + kRounds) << "Hello, Login, Ping";
  EXPECT_EQ(counters.messages_parsed_off_thread, 0u);
  EXPECT_LT(counters.decoded_bytes, 64u << 10);
  std::fprintf(stderr, "parsing: resident memory grew by %llu KiB\n",
               static_cast<unsigned long long>((most - before) >> 10));
  // each connection's buffer holds a message and the rest of a read, twice while it grows
  if (!kSanitized) {
    EXPECT_LT(most - before, 64u << 20);
  }
}

}  // namespace
}  // namespace needlelab::test
