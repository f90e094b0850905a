#include "client/net/client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <thread>

#include "client/net/blocking_client.h"
#include "common/wire/certificates.h"
#include "common/wire/protocol.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

/// A server that follows a script: answers each envelope with what the test says.
class ScriptedServer {
 public:
  using Script = std::function<std::vector<pb::Envelope>(const pb::Envelope&)>;

  explicit ScriptedServer(Script script) : script_(std::move(script)) {
    if (!ensureTlsFiles(files, {"localhost", "127.0.0.1"}).ok()) throw std::runtime_error("no certificates");
    tls_ = *makeServerTls(files.certificate, files.key);
    thread_ = std::thread([this] {
      asio::co_spawn(io_, serve(), rethrow);
      io_.run();
    });
  }
  ~ScriptedServer() {
    io_.stop();
    thread_.join();
  }
  [[nodiscard]] ClientConfig config() const {
    ClientConfig config;
    config.server.port = acceptor_.local_endpoint().port();
    config.ca_file = files.ca_certificate;
    config.login = personLogin("anna", "secret");
    config.connect_timeout = milliseconds(2000);
    config.limits.close_grace = milliseconds(100);
    return config;
  }

  test::TempFolder folder;
  TlsFiles files = tlsFilesIn(folder.path());

 private:
  Task<> serve() {
    auto [error, socket] = co_await acceptor_.async_accept(kUseTuple);
    if (error) co_return;
    auto channel = Channel::make(TlsStream(std::move(socket), *tls_), {});
    const Status shaken = co_await channel->handshake(asio::ssl::stream_base::server);
    if (!shaken.ok()) co_return;
    for (;;) {
      auto got = co_await channel->receive();
      if (!got.ok()) co_return;
      for (const auto& answer : script_(*got)) channel->send(answer);
    }
  }

  Script script_;
  asio::io_context io_{1};
  Tcp::acceptor acceptor_{io_, Tcp::endpoint(asio::ip::address_v4::loopback(), 0)};
  TlsContext tls_;
  std::thread thread_;
};

pb::Envelope hello() {
  pb::Envelope envelope;
  *envelope.mutable_hello()->mutable_version() = ourVersion();
  return envelope;
}

std::vector<pb::Envelope> friendly(const pb::Envelope& got) {
  if (got.has_hello()) return {hello()};
  pb::Envelope envelope;
  if (got.has_login()) envelope.mutable_welcome()->set_name(got.login().person().user());
  return got.has_login() ? std::vector{envelope} : std::vector<pb::Envelope>{};
}

TEST(Client, whoAcceptsAndSaysNothingTimesOut) {
  asio::io_context io;
  Tcp::acceptor silent(io, Tcp::endpoint(asio::ip::address_v4::loopback(), 0));
  ScriptedServer other(friendly);
  auto config = other.config();
  config.server.port = silent.local_endpoint().port();
  config.connect_timeout = milliseconds(300);
  const auto started = std::chrono::steady_clock::now();
  const auto client = BlockingClient::connect(config);
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kUnavailable);
  EXPECT_LT(std::chrono::steady_clock::now() - started, milliseconds(2500));
}

TEST(Client, aNameThatNobodyKnowsIsUnavailable) {
  ScriptedServer server(friendly);
  auto config = server.config();
  config.server.host = "no.such.host.invalid";
  const auto client = BlockingClient::connect(config);
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(client.error().message, HasSubstr("no.such.host.invalid"));
}

TEST(Client, aMissingCaFileIsNamed) {
  ScriptedServer server(friendly);
  auto config = server.config();
  config.ca_file = "/nowhere/ca.crt";
  const auto client = BlockingClient::connect(config);
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(client.error().message, HasSubstr("/nowhere/ca.crt"));
}

TEST(Client, aServerOfAnotherMajorIsNotTrustedToRefuse) {
  // an old server that answers everybody with its own version
  ScriptedServer server([](const pb::Envelope&) {
    pb::Envelope envelope = hello();
    envelope.mutable_hello()->mutable_version()->set_major(kProtocolMajor + 1);
    return std::vector{envelope};
  });
  const auto client = BlockingClient::connect(server.config());
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kVersion);
}

TEST(Client, aPeerThatAnswersNonsenseIsNoServer) {
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
    answers[1].mutable_reply()->set_id(got.request().id() + 100);  // somebody else's
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

TEST(BlockingClient, silenceIsNotFoundAndTheConnectionGoesOn) {
  ScriptedServer server(friendly);
  auto client = BlockingClient::connect(server.config());
  ASSERT_TRUE(client.ok());
  EXPECT_EQ(client->receive(milliseconds(20)).error().code, ErrorCode::kNotFound);
  EXPECT_TRUE(client->connected());
  pb::Request request;
  request.mutable_list_users();
  const auto reply = client->call(request, milliseconds(50));
  ASSERT_FALSE(reply.ok());
  EXPECT_EQ(reply.error().code, ErrorCode::kUnavailable);
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

}  // namespace
}  // namespace needlelab
