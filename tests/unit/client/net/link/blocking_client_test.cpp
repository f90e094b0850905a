#include "client/net/link/blocking_client.h"
#include "tests/support/patience.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <optional>

#include "tests/unit/client/net/link/scripted_server.h"

namespace needlelab {
namespace {

using namespace test;
using std::chrono::milliseconds;
using testing::HasSubstr;

constexpr std::int64_t kSecond_ns = 1'000'000'000;

TEST(ConnectClient, anUnresolvableNameIsUnavailable) {
  ScriptedServer server(friendly);
  auto config = server.config();
  config.server.host = "no.such.host.invalid";
  const auto client = BlockingClient::connect(config);
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(client.error().message, HasSubstr("no.such.host.invalid"));
}

TEST(ConnectClient, aMissingCaFileIsNamed) {
  ScriptedServer server(friendly);
  auto config = server.config();
  config.ca_file = "/nowhere/ca.crt";
  const auto client = BlockingClient::connect(config);
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(client.error().message, HasSubstr("/nowhere/ca.crt"));
}

TEST(ConnectClient, aServerOfAnotherMajorIsNotTrustedToRefuse) {
  // an old server that answers every client with its own version
  ScriptedServer server([](const pb::Envelope&) {
    pb::Envelope envelope = hello();
    envelope.mutable_hello()->mutable_version()->set_major(kProtocolMajor + 1);
    return std::vector{envelope};
  });
  const auto client = BlockingClient::connect(server.config());
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kVersion);
}

TEST(ConnectClient, aPeerThatAnswersNonsenseIsNoServer) {
  ScriptedServer server([](const pb::Envelope&) {
    pb::Envelope envelope;
    envelope.mutable_ack();
    return std::vector{envelope};
  });
  const auto client = BlockingClient::connect(server.config());
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kCorrupt);
}

TEST(BlockingClient, repliesAreFoundAmongOtherMessagesWhichAreKept) {
  ScriptedServer server([](const pb::Envelope& got) {
    if (!got.has_request()) return friendly(got);
    std::vector<pb::Envelope> answers(4);
    answers[0].mutable_trainee_message()->set_text("meanwhile");
    answers[1].mutable_reply()->set_id(got.request().id() + 100);  // the reply to another request
    answers[2].mutable_ping();
    answers[3].mutable_reply()->set_id(got.request().id());
    answers[3].mutable_reply()->mutable_done();
    return answers;
  });
  auto client = BlockingClient::connect(server.config());
  ASSERT_TRUE(client.ok()) << client.error().message;
  EXPECT_EQ(client->welcome().name(), "anna");
  pb::Request request;
  request.mutable_list_users();
  ASSERT_TRUE(client->call(request).ok());
  const auto kept = client->receive(milliseconds(100));
  ASSERT_TRUE(kept.ok());
  EXPECT_EQ(kept->trainee_message().text(), "meanwhile");
}

TEST(BlockingClient, theReasonOfAnEndIsKept) {
  ScriptedServer server([](const pb::Envelope& got) {
    if (!got.has_request()) return friendly(got);
    pb::Envelope envelope;
    *envelope.mutable_refusal() = makeRefusal(pb::Refusal::SHUTTING_DOWN, "moving house", true);
    return std::vector{envelope};
  });
  auto client = BlockingClient::connect(server.config());
  ASSERT_TRUE(client.ok());
  pb::Request request;
  request.mutable_list_users();
  const auto reply = client->call(request);
  ASSERT_FALSE(reply.ok());
  EXPECT_THAT(reply.error().message, HasSubstr("moving house"));
  EXPECT_FALSE(client->connected());
}

TEST(BlockingClient, theFirstServerThatAnswersIsUsed) {
  ScriptedServer server(friendly);
  auto config = server.config();
  const Endpoint there = config.server;
  config.setServers({{"127.0.0.1", 1}, {"no.such.host.invalid", 1}, there});
  const auto client = BlockingClient::connect(config);
  ASSERT_TRUE(client.ok()) << client.error().message;
  EXPECT_EQ(endpointText(client->server()), endpointText(there));
  config.setServers({{"127.0.0.1", 1}, {"no.such.host.invalid", 1}});
  const auto nobody = BlockingClient::connect(config);
  ASSERT_FALSE(nobody.ok());
  EXPECT_EQ(nobody.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(nobody.error().message,
              testing::AllOf(HasSubstr("127.0.0.1:1: "), HasSubstr("no.such.host.invalid:1: ")));
}

TEST(BlockingClient, aWrongPasswordIsReportedWithoutTryingOtherServers) {
  const std::atomic<bool> deny{true};
  ScriptedServer first(friendlyUnless(deny));
  ScriptedServer second(friendly, first.files);
  auto config = first.config();
  config.others = {{"127.0.0.1", second.port()}};
  const auto client = BlockingClient::connect(config);
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kDenied);
  EXPECT_THAT(client.error().message, HasSubstr(endpointText(config.server)));
  EXPECT_EQ(second.logins(), 0u);
}

// --- on a simulated clock

class BlockingClientTime : public testing::Test {
 protected:
  // logs in to `server`; no time passes
  void connect(const ScriptedServer& server) {
    LinkSettings settings;
    settings.seed = 7;
    settings.clock = clock_;
    auto config = server.config();
    // a server deletes its files when it ends
    std::filesystem::copy_file(config.ca_file, folder_.path() / "ca.crt");
    config.ca_file = folder_.path() / "ca.crt";
    auto client = BlockingClient::connect(config, settings);
    ASSERT_TRUE(client.ok()) << client.error().message;
    client_.emplace(std::move(*client));
  }
  // the goodbye takes no time either
  void TearDown() override {
    clock_->passes = [] { return false; };
    client_.reset();
  }

  const TempFolder folder_;
  std::shared_ptr<TestClock> clock_ = std::make_shared<TestClock>();
  const std::int64_t begun_ns_ = clock_->steadyNs();
  std::optional<BlockingClient> client_;
};

TEST_F(BlockingClientTime, aCallGivesUpExactlyAfterItsTimeout) {
  ScriptedServer server(friendly);
  ASSERT_NO_FATAL_FAILURE(connect(server));
  // the server has received the request and does not answer
  clock_->passes = [&] { return server.count([](const pb::Envelope& e) { return e.has_request(); }) == 1; };
  pb::Request request;
  request.mutable_list_users();
  const auto reply = client_->call(request, milliseconds(10'500));
  ASSERT_FALSE(reply.ok());
  EXPECT_EQ(reply.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(reply.error().message, HasSubstr("within 10500 ms"));
  EXPECT_EQ(client_->nowNs() - begun_ns_, 10'500'000'000);
  EXPECT_TRUE(client_->connected());
}

TEST_F(BlockingClientTime, anAnswerThatComesInTimeEndsTheCallAtOnce) {
  ScriptedServer server([](const pb::Envelope& got) {
    return got.has_request() ? std::vector{doneWith(got.request())} : friendly(got);
  });
  ASSERT_NO_FATAL_FAILURE(connect(server));
  pb::Request request;
  request.mutable_list_users();
  EXPECT_TRUE(client_->call(request, milliseconds(1)).ok()) << "however long the machine takes";
  EXPECT_EQ(client_->nowNs(), begun_ns_);
}

TEST_F(BlockingClientTime, receiveWaitsExactlyItsTime) {
  ScriptedServer server(friendly);
  ASSERT_NO_FATAL_FAILURE(connect(server));
  clock_->passes = [] { return true; };
  const auto got = client_->receive(milliseconds(90'000));
  EXPECT_EQ(got.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(got.error().message, HasSubstr("within 90000 ms"));
  EXPECT_EQ(client_->nowNs() - begun_ns_, 90 * kSecond_ns);
  EXPECT_TRUE(client_->connected());
}

// The waits match a back-off with the same seed. Meanwhile the client checks every 20 ms, and after each
// attempt, whether it should stop.
TEST_F(BlockingClientTime, reconnectBacksOffAndChecksForStopUntilTimeout) {
  std::optional<ScriptedServer> server(std::in_place, friendly);
  ASSERT_NO_FATAL_FAILURE(connect(*server));
  server.reset();
  while (client_->receive(milliseconds(1)).ok()) {
  }
  clock_->passes = [this] { return clock_->linkWaits(); };
  std::int64_t looks = 0;
  const Status status = client_->reconnect(begun_ns_ + 60 * kSecond_ns, [&] { return ++looks < 0; });
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kUnavailable) << status.error().message;
  EXPECT_EQ(client_->nowNs() - begun_ns_, 60 * kSecond_ns);

  Backoff same(7, {});
  std::vector<milliseconds> waits{same.next()};
  std::int64_t now_ms = 0, next_try_ms = waits.back().count(), expected_looks = 0;
  while (now_ms < 60'000) {
    ++expected_looks;
    const std::int64_t step_ms = std::min<std::int64_t>(60'000, now_ms + 20);
    if (next_try_ms >= step_ms) {
      now_ms = step_ms;
      continue;
    }
    now_ms = next_try_ms;
    waits.push_back(same.next());
    next_try_ms = now_ms + waits.back().count();
  }
  EXPECT_EQ(clock_->asked, waits);
  EXPECT_EQ(looks, expected_looks);
}

TEST_F(BlockingClientTime, aStopEndsReconnectAtTheNextLook) {
  std::optional<ScriptedServer> server(std::in_place, friendly);
  ASSERT_NO_FATAL_FAILURE(connect(*server));
  server.reset();
  while (client_->receive(milliseconds(1)).ok()) {
  }
  clock_->passes = [this] { return clock_->linkWaits(); };
  int looks = 0;
  const Status status = client_->reconnect(INT64_MAX, [&] { return ++looks == 4; });
  EXPECT_EQ(status.error().code, ErrorCode::kUnavailable);
  // the first wait is at least 100 ms: no attempt yet
  EXPECT_EQ(client_->nowNs() - begun_ns_, 60'000'000);
  EXPECT_EQ(clock_->asked.size(), 1u);
}

TEST(BlockingClient, reconnectsOnRequest) {
  std::atomic<bool> deny{false};
  ScriptedServer server(friendlyUnless(deny));
  auto client = BlockingClient::connect(server.config());
  ASSERT_TRUE(client.ok()) << client.error().message;
  const auto lose = [&] {
    server.dropConnections();
    while (client->receive(kPatience).ok()) {
    }
  };
  lose();
  EXPECT_FALSE(client->connected());
  const auto back = client->reconnect(client->nowNs() + 20 * kSecond_ns, [] { return false; });
  ASSERT_TRUE(back.ok()) << back.error().message;
  EXPECT_TRUE(client->connected());
  // refused: no second attempt
  lose();
  deny = true;
  EXPECT_EQ(client->reconnect(client->nowNs() + 3600 * kSecond_ns, [] { return false; }).error().code,
            ErrorCode::kDenied);
  EXPECT_EQ(server.logins(), 3u);
}

}  // namespace
}  // namespace needlelab
