#include "client/net/server_link.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <optional>
#include <thread>

#include "client/net/blocking_client.h"
#include "common/wire/certificates.h"
#include "common/wire/protocol.h"
#include "tests/support/fake_time.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using std::chrono::milliseconds;
constexpr std::int64_t kSecond_ns = 1'000'000'000;
using testing::HasSubstr;

/// A scripted server: answers each envelope as the test defines, on any number of connections.
class ScriptedServer {
 public:
  using Script = std::function<std::vector<pb::Envelope>(const pb::Envelope&)>;

  explicit ScriptedServer(Script script) : script_(std::move(script)) {
    if (!ensureTlsFiles(files, {{"localhost", "127.0.0.1"}}).ok())
      throw std::runtime_error("no certificates");
    tls_ = *makeServerTls(files.certificate, files.key);
    asio::co_spawn(io_, accept(), rethrow);
    thread_ = std::thread([this] { io_.run(); });
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
  /// Returns all received envelopes, on all connections.
  std::vector<pb::Envelope> received() {
    const std::scoped_lock lock(mutex_);
    return received_;
  }
  std::size_t count(const std::function<bool(const pb::Envelope&)>& which) {
    const auto all = received();
    return static_cast<std::size_t>(std::count_if(all.begin(), all.end(), which));
  }
  std::size_t logins() {
    return count([](const pb::Envelope& e) { return e.has_login(); });
  }
  void broadcast(const pb::Envelope& envelope) {
    asio::post(io_, [this, envelope] {
      for (const auto& channel : channels_) channel->send(envelope);
    });
  }
  void dropConnections() {
    asio::post(io_, [this] {
      for (const auto& channel : channels_) channel->close(CloseReason::kLocal, "the test cuts it");
      channels_.clear();
    });
  }

  test::TempFolder folder;
  TlsFiles files = tlsFilesIn(folder.path());

 private:
  Task<> accept() {
    for (;;) {
      auto [error, socket] = co_await acceptor_.async_accept(kUseTuple);
      if (error) co_return;
      asio::co_spawn(io_, serve(Channel::make(TlsStream(std::move(socket), *tls_), {})), rethrow);
    }
  }
  Task<> serve(std::shared_ptr<Channel> channel) {
    const Status shaken = co_await channel->handshake(asio::ssl::stream_base::server);
    if (!shaken.ok()) co_return;
    channels_.push_back(channel);
    for (;;) {
      auto got = co_await channel->receive();
      if (!got.ok()) co_return;
      {
        const std::scoped_lock lock(mutex_);
        received_.push_back(*got);
      }
      for (const auto& answer : script_(*got)) channel->send(answer);
    }
  }

  Script script_;
  asio::io_context io_{1};
  Tcp::acceptor acceptor_{io_, Tcp::endpoint(asio::ip::address_v4::loopback(), 0)};
  TlsContext tls_;
  std::vector<std::shared_ptr<Channel>> channels_;
  std::mutex mutex_;
  std::vector<pb::Envelope> received_;
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
  const auto client = BlockingClient::connect(config);
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kUnavailable);
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

// --- the link, on a simulated clock that the test moves

class TestClock : public LinkClock {
 public:
  TestClock() : LinkClock(time_) {}
  [[nodiscard]] std::int64_t unixNs() const override { return steadyNs(); }
  Task<> wait(asio::steady_timer& timer, milliseconds time) override {
    const std::int64_t due_ns =
        time >= ServerLink::kForever ? INT64_MAX : steadyNs() + std::chrono::nanoseconds(time).count();
    if (time < ServerLink::kForever) asked.push_back(time);
    waits_.emplace_back(due_ns, &timer);
    timer.expires_at(asio::steady_timer::time_point::max());
    co_await timer.async_wait(kUseTuple);
    std::erase_if(waits_, [&](const auto& each) { return each.second == &timer; });
  }
  /// What the peer sends takes none of this time. When nothing is to be done and `passes` says so, the time
  /// moves on to the next due time.
  void runOne(asio::io_context& io, std::int64_t due_ns) override {
    if (io.poll_one() > 0) return;
    if (!passes()) {
      io.run_one_for(milliseconds(2));
      return;
    }
    for (const auto& each : waits_)
      if (each.first > steadyNs()) due_ns = std::min(due_ns, each.first);
    advanceTo(due_ns);
  }
  void advance(milliseconds time) { advanceTo(steadyNs() + std::chrono::nanoseconds(time).count()); }
  void advanceTo(std::int64_t to_ns) {
    time_.advanceTo(to_ns);
    for (const auto& [due_ns, timer] : waits_)
      if (due_ns <= steadyNs()) timer->cancel();
  }
  /// The link waits for a time, of its back-off or of a request's limit.
  [[nodiscard]] bool linkWaits() const {
    return std::any_of(waits_.begin(), waits_.end(), [this](const auto& each) {
      return each.first > steadyNs() && each.first < INT64_MAX;
    });
  }
  std::vector<milliseconds> asked;
  std::function<bool()> passes = [] { return false; };

 private:
  test::FakeTime time_;
  std::vector<std::pair<std::int64_t, asio::steady_timer*>> waits_;
};

class ServerLinkTest : public testing::Test {
 protected:
  asio::io_context io_{1};
  std::shared_ptr<TestClock> clock_ = std::make_shared<TestClock>();
  std::vector<LinkEnd> ends_;
  std::vector<std::string> messages_;
  Retry retry_ = Retry::kBackOff;
  std::optional<ServerLink> link_;

  void makeLink() {
    LinkSettings settings;
    settings.retry = {milliseconds(200), milliseconds(10'000), 2.0};
    settings.seed = 7;
    settings.clock = clock_;
    link_.emplace(
        io_, settings,
        LinkHandlers{.accept = {},
                     .connected = {},
                     .message = [this](pb::Envelope& e) { messages_.push_back(e.ShortDebugString()); },
                     .judge = [this](const LinkEnd&) { return retry_; },
                     .away = [this](const LinkEnd& end) { ends_.push_back(end); }});
  }
  /// Runs the link until the condition holds. TLS and sockets need real time; the link's own clock stands
  /// still.
  bool until(const std::function<bool()>& so) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (!so()) {
      if (std::chrono::steady_clock::now() > end) return false;
      io_.restart();
      io_.run_for(milliseconds(2));
    }
    return true;
  }
  /// Runs the link for some turns; nothing that it waits for arrives.
  void settle() {
    io_.restart();
    io_.run_for(milliseconds(30));
  }
  bool online() {
    return until([&] { return link_->online(); });
  }
  bool away(std::size_t times) {
    return until([&] { return ends_.size() == times; });
  }
  static bool hasRequest(const pb::Envelope& envelope) { return envelope.has_request(); }
  static pb::Request listUsers() {
    pb::Request request;
    request.mutable_list_users();
    return request;
  }
};

TEST_F(ServerLinkTest, waitsLongerAfterEachFailure) {
  ScriptedServer server(friendly);
  auto config = server.config();
  {
    asio::io_context other;
    Tcp::acceptor nobody(other, Tcp::endpoint(asio::ip::address_v4::loopback(), 0));
    config.server.port = nobody.local_endpoint().port();
  }
  makeLink();
  link_->logIn(config);
  Backoff same(7, {milliseconds(200), milliseconds(10'000), 2.0});
  for (std::size_t n = 1; n <= 8; ++n) {
    ASSERT_TRUE(away(n));
    EXPECT_FALSE(ends_.back().was_connected);
    EXPECT_EQ(ends_.back().error.code, ErrorCode::kUnavailable);
    settle();
    const milliseconds wait = same.next();
    ASSERT_EQ(clock_->asked.size(), n);
    EXPECT_EQ(clock_->asked.back(), wait);
    EXPECT_EQ(ends_.back().next_try_ns, clock_->steadyNs() + std::chrono::nanoseconds(wait).count());
    clock_->advance(wait - milliseconds(1));
    settle();
    EXPECT_EQ(ends_.size(), n) << "too early";
    clock_->advance(milliseconds(1));
  }
}

TEST_F(ServerLinkTest, aProbedServerIsTriedAgainWithinTheLimitAndFoundOnceItAccepts) {
  ScriptedServer server(friendly);
  auto config = server.config();
  const std::uint16_t listening = config.server.port;
  {
    asio::io_context other;
    Tcp::acceptor nobody(other, Tcp::endpoint(asio::ip::address_v4::loopback(), 0));
    config.server.port = nobody.local_endpoint().port();
  }
  makeLink();
  retry_ = Retry::kProbe;
  link_->logIn(config);
  Backoff same(7, {milliseconds(200), milliseconds(10'000), 2.0});
  for (std::size_t n = 1; n <= 20; ++n) {
    ASSERT_TRUE(away(n));
    EXPECT_FALSE(ends_.back().reached);
    settle();
    const milliseconds wait = same.nextProbe();
    ASSERT_EQ(clock_->asked.size(), n);
    EXPECT_EQ(clock_->asked.back(), wait);
    EXPECT_LE(wait, milliseconds(1500));
    clock_->advance(wait);
  }
  config.server.port = listening;
  link_->logIn(config);
  ASSERT_TRUE(online());
  server.dropConnections();
  ASSERT_TRUE(until([&] { return !ends_.empty() && ends_.back().was_connected; }));
  EXPECT_TRUE(ends_.back().reached);
}

TEST_F(ServerLinkTest, aServerThatAcceptsAndSaysNothingWasReached) {
  asio::io_context other;
  Tcp::acceptor silent(other, Tcp::endpoint(asio::ip::address_v4::loopback(), 0));
  ScriptedServer server(friendly);
  auto config = server.config();
  config.server.port = silent.local_endpoint().port();
  config.connect_timeout = milliseconds(100);
  makeLink();
  link_->logIn(config);
  ASSERT_TRUE(away(1));
  EXPECT_FALSE(ends_.back().was_connected);
  EXPECT_TRUE(ends_.back().reached);
}

TEST_F(ServerLinkTest, onlyAConnectionThatLastedResetsTheBackOff) {
  ScriptedServer server(friendly);
  makeLink();
  link_->logIn(server.config());
  const auto lose = [&](std::size_t times) {
    if (!online()) return false;
    server.dropConnections();
    if (!away(times)) return false;
    settle();
    return true;
  };
  Backoff same(7, {milliseconds(200), milliseconds(10'000), 2.0});
  std::vector<milliseconds> waits;
  for (std::size_t times = 1; times <= 4; ++times) {
    ASSERT_TRUE(lose(times));
    EXPECT_TRUE(ends_.back().was_connected);
    EXPECT_FALSE(ends_.back().said_by_server);
    waits.push_back(same.next());
    EXPECT_EQ(clock_->asked, waits) << "a connection that is lost at once is no success";
    clock_->advance(waits.back());
    ASSERT_TRUE(online());
    // the third lasts as long as is not enough, the fourth 1 ms more
    if (times >= 3) clock_->advance(milliseconds(times == 3 ? 10'000 : 10'001));
  }
  ASSERT_TRUE(lose(5));
  same.reset();
  waits.push_back(same.next());
  EXPECT_EQ(clock_->asked, waits);
  EXPECT_LE(clock_->asked.back(), milliseconds(200));
  EXPECT_EQ(link_->connections(), 5u);
}

TEST_F(ServerLinkTest, aLinkThatMayNotReconnectWaitsForTheWordAndThenItsBackOff) {
  ScriptedServer server(friendly);
  makeLink();
  link_->logIn(server.config());
  ASSERT_TRUE(online());
  link_->reconnect(false);
  server.dropConnections();
  ASSERT_TRUE(away(1));
  EXPECT_EQ(ends_.back().next_try_ns, 0);
  settle();
  clock_->advance(std::chrono::hours(1000));
  settle();
  EXPECT_EQ(server.logins(), 1u) << "not by itself";
  EXPECT_TRUE(clock_->asked.empty());
  link_->reconnect(true);
  ASSERT_TRUE(until([&] { return clock_->asked.size() == 1; }));
  EXPECT_FALSE(link_->online());
  clock_->advance(clock_->asked.back());
  ASSERT_TRUE(online());
  EXPECT_EQ(server.logins(), 2u);
}

TEST_F(ServerLinkTest, theTokenIsUsedWhileItIsValidAndThePasswordAfterwards) {
  std::atomic<bool> refuse_tokens{false};
  const std::int64_t until_ns = clock_->unixNs() + 60'000'000'000;
  ScriptedServer server([&](const pb::Envelope& got) -> std::vector<pb::Envelope> {
    if (!got.has_login()) return friendly(got);
    pb::Envelope answer;
    if (got.login().has_token() && refuse_tokens) {
      *answer.mutable_refusal() = makeRefusal(pb::Refusal::LOGIN, "no such token", true);
      return {answer};
    }
    answer.mutable_welcome()->set_token("t1");
    answer.mutable_welcome()->set_token_expires_unix_ns(until_ns);
    return {answer};
  });
  makeLink();
  link_->logIn(server.config());
  const auto byToken = [&](std::size_t login) {
    const auto all = server.received();
    for (const auto& each : all)
      if (each.has_login() && login-- == 0) return each.login().has_token();
    ADD_FAILURE();
    return false;
  };
  const auto again = [&](std::size_t logins) {
    server.dropConnections();
    if (!until([&] { return !link_->online(); })) return false;
    settle();
    clock_->advance(milliseconds(10'000));
    return online() && server.logins() == logins;
  };
  ASSERT_TRUE(online());
  EXPECT_FALSE(byToken(0));
  ASSERT_TRUE(again(2));
  EXPECT_TRUE(byToken(1));
  refuse_tokens = true;  // the server has restarted
  ASSERT_TRUE(again(4)) << "with the password at once";
  EXPECT_TRUE(byToken(2));
  EXPECT_FALSE(byToken(3));
  refuse_tokens = false;
  clock_->advance(milliseconds(60'000));
  ASSERT_TRUE(again(5));
  EXPECT_FALSE(byToken(4)) << "it has expired";
}

TEST_F(ServerLinkTest, requestsThatReadAreSentAgainAndOthersAreGivenUp) {
  std::atomic<bool> answer{false};
  ScriptedServer server([&](const pb::Envelope& got) -> std::vector<pb::Envelope> {
    if (!got.has_request()) return friendly(got);
    pb::Envelope reply;
    reply.mutable_reply()->set_id(got.request().id());
    reply.mutable_reply()->mutable_done();
    return answer ? std::vector{reply} : std::vector<pb::Envelope>{};
  });
  makeLink();
  std::optional<Result<pb::Reply>> reads, acts, offline;
  const auto into = [](auto& where) {
    return [&where](Result<pb::Reply> reply) { where.emplace(std::move(reply)); };
  };
  link_->ask(listUsers(), into(offline), OnLoss::kGiveUp);
  ASSERT_TRUE(offline.has_value()) << "at once: there is no connection";
  EXPECT_THAT(offline->error().message, HasSubstr("nothing was done"));
  link_->logIn(server.config());
  ASSERT_TRUE(online());
  link_->ask(listUsers(), into(reads));
  link_->ask(listUsers(), into(acts), OnLoss::kGiveUp);
  ASSERT_TRUE(until([&] { return server.count(hasRequest) == 2; }));
  server.dropConnections();
  ASSERT_TRUE(away(1));
  ASSERT_TRUE(acts.has_value());
  EXPECT_EQ(acts->error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(acts->error().message, HasSubstr("look whether it happened"));
  EXPECT_FALSE(reads.has_value());
  EXPECT_EQ(link_->waiting(), 1u);
  answer = true;
  settle();
  clock_->advance(milliseconds(10'000));
  ASSERT_TRUE(until([&] { return reads.has_value(); }));
  EXPECT_TRUE(reads->ok());
  EXPECT_EQ(link_->waiting(), 0u);
}

TEST_F(ServerLinkTest, aRequestIsGivenUpAfterItsPatience) {
  ScriptedServer server(friendly);
  makeLink();
  link_->logIn(server.config());
  ASSERT_TRUE(online());
  std::optional<Result<pb::Reply>> reply;
  link_->ask(
      listUsers(), [&](Result<pb::Reply> got) { reply.emplace(std::move(got)); }, OnLoss::kAskAgain,
      milliseconds(60'000));
  settle();
  clock_->advance(milliseconds(59'000));
  settle();
  EXPECT_FALSE(reply.has_value());
  clock_->advance(milliseconds(1'000));
  ASSERT_TRUE(until([&] { return reply.has_value(); }));
  EXPECT_EQ(reply->error().code, ErrorCode::kUnavailable);
  EXPECT_TRUE(link_->online());
}

TEST_F(ServerLinkTest, noMoreThanSoManyRequestsWait) {
  ScriptedServer server(friendly);
  makeLink();
  std::size_t refused = 0;
  for (int i = 0; i < 300; ++i)
    link_->ask(listUsers(), [&](const Result<pb::Reply>& got) { refused += got.ok() ? 0 : 1; });
  EXPECT_EQ(link_->waiting(), 256u);
  EXPECT_EQ(refused, 44u);
}

TEST_F(ServerLinkTest, aServerThatRefusesIsTriedAgainAsItsOwnerSays) {
  std::atomic<bool> deny{true};
  ScriptedServer server([&](const pb::Envelope& got) -> std::vector<pb::Envelope> {
    if (!got.has_login() || !deny) return friendly(got);
    pb::Envelope no;
    *no.mutable_refusal() = makeRefusal(pb::Refusal::LOGIN, "wrong password", true);
    return {no};
  });
  makeLink();
  retry_ = Retry::kSlowly;
  link_->logIn(server.config());
  ASSERT_TRUE(away(1));
  EXPECT_EQ(ends_.back().error.code, ErrorCode::kDenied);
  settle();
  EXPECT_EQ(clock_->asked.back(), milliseconds(10'000));
  retry_ = Retry::kNever;
  clock_->advance(milliseconds(10'000));
  ASSERT_TRUE(away(2));
  EXPECT_EQ(ends_.back().next_try_ns, 0);
  settle();
  clock_->advance(std::chrono::hours(1000));
  settle();
  EXPECT_EQ(server.logins(), 2u) << "a person has to do something first";
  deny = false;
  link_->retryNow();
  ASSERT_TRUE(online());
}

TEST_F(ServerLinkTest, theServersOwnReasonForTheEndIsKept) {
  ScriptedServer server(friendly);
  makeLink();
  link_->logIn(server.config());
  ASSERT_TRUE(online());
  pb::Envelope bye;
  bye.mutable_bye()->set_reason("moving house");
  server.broadcast(bye);
  ASSERT_TRUE(away(1));
  EXPECT_TRUE(ends_.back().said_by_server);
  EXPECT_THAT(ends_.back().error.message, HasSubstr("moving house"));
  EXPECT_THAT(ends_.back().channel_text, HasSubstr("moving house"));
  EXPECT_EQ(messages_.size(), 1u);
}

TEST_F(ServerLinkTest, pingsAreAnsweredAndOtherMessagesHandedOver) {
  ScriptedServer server(friendly);
  makeLink();
  link_->logIn(server.config());
  ASSERT_TRUE(online());
  pb::Envelope ping, message, late;
  ping.mutable_ping()->set_id(5);
  message.mutable_trainee_message()->set_text("slower");
  late.mutable_reply()->set_id(77);  // no caller waits for it any longer
  for (const auto& each : {ping, message, late}) server.broadcast(each);
  ASSERT_TRUE(until([&] { return messages_.size() == 2; }));
  ASSERT_TRUE(until([&] { return server.count([](const auto& e) { return e.has_pong(); }) == 1; }));
  EXPECT_THAT(messages_[0], HasSubstr("slower"));
}

TEST_F(ServerLinkTest, stopSaysByeAndAnOwnerThatGoesHearsNothing) {
  ScriptedServer server(friendly);
  makeLink();
  link_->logIn(server.config());
  ASSERT_TRUE(online());
  std::optional<Result<pb::Reply>> reply;
  link_->ask(listUsers(), [&](Result<pb::Reply> got) { reply.emplace(std::move(got)); });
  bool done = false;
  link_->stop("the test ends", [&] { done = true; });
  ASSERT_TRUE(until([&] { return done; }));
  EXPECT_EQ(reply->error().code, ErrorCode::kFailed);
  EXPECT_TRUE(ends_.back().stopping);
  ASSERT_TRUE(until([&] {
    return server.count([](const auto& e) { return e.has_bye() && e.bye().reason() == "the test ends"; }) ==
           1;
  }));

  // The next link is destroyed while it is connected, another one while it connects.
  ends_.clear();
  makeLink();
  link_->logIn(server.config());
  ASSERT_TRUE(online());
  link_.reset();
  makeLink();
  link_->logIn(server.config());
  settle();
  link_.reset();
  settle();
  EXPECT_TRUE(ends_.empty());
}

TEST_F(ServerLinkTest, anotherLogInTakesThePlaceOfTheFirst) {
  ScriptedServer server(friendly);
  makeLink();
  link_->logIn(server.config());
  ASSERT_TRUE(online());
  auto other = server.config();
  other.login = personLogin("bert", "secret");
  link_->logIn(other);
  ASSERT_TRUE(until([&] { return link_->online() && link_->welcome().name() == "bert"; }));
  EXPECT_TRUE(ends_.empty()) << "the owner wanted it";
  link_->logOut("logged out");
  ASSERT_TRUE(until([&] { return !link_->online(); }));
  settle();
  EXPECT_EQ(server.logins(), 2u);
}

// --- the blocking client, on a simulated clock

class BlockingClientTime : public testing::Test {
 protected:
  // logs in to `server`; no time passes
  void connect(const ScriptedServer& server) {
    LinkSettings settings;
    settings.seed = 7;
    settings.clock = clock_;
    auto config = server.config();
    // a server that ends takes its files along
    std::filesystem::copy_file(config.ca_file, folder_.path() / "ca.crt");
    config.ca_file = folder_.path() / "ca.crt";
    auto client = BlockingClient::connect(config, settings);
    ASSERT_TRUE(client.ok()) << client.error().message;
    client_.emplace(std::move(*client));
  }
  // says goodbye, which takes no time either
  void TearDown() override {
    clock_->passes = [] { return false; };
    client_.reset();
  }

  const test::TempFolder folder_;
  std::shared_ptr<TestClock> clock_ = std::make_shared<TestClock>();
  const std::int64_t begun_ns_ = clock_->steadyNs();
  std::optional<BlockingClient> client_;
};

TEST_F(BlockingClientTime, aCallGivesUpExactlyAfterItsTimeout) {
  ScriptedServer server(friendly);
  ASSERT_NO_FATAL_FAILURE(connect(server));
  // the server has the request and does not answer it
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
    if (!got.has_request()) return friendly(got);
    pb::Envelope answer;
    answer.mutable_reply()->set_id(got.request().id());
    answer.mutable_reply()->mutable_done();
    return std::vector{answer};
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

// The waits are those of a back-off with the same seed. Meanwhile it looks every 20 ms, and after each
// attempt, whether somebody stops it.
TEST_F(BlockingClientTime, reconnectTriesByTheBackOffAndLooksForAStopUntilItsTimeIsOver) {
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

TEST(BlockingClient, reconnectsWhenItIsTold) {
  std::atomic<bool> deny{false};
  ScriptedServer server([&](const pb::Envelope& got) -> std::vector<pb::Envelope> {
    if (!got.has_login() || !deny) return friendly(got);
    pb::Envelope no;
    *no.mutable_refusal() = makeRefusal(pb::Refusal::LOGIN, "wrong password", true);
    return {no};
  });
  auto client = BlockingClient::connect(server.config());
  ASSERT_TRUE(client.ok()) << client.error().message;
  const auto lose = [&] {
    server.dropConnections();
    while (client->receive(milliseconds(1000)).ok()) {
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
  // stopped by the user
  EXPECT_EQ(client->reconnect(client->nowNs() + 30 * kSecond_ns, [] { return true; }).error().code,
            ErrorCode::kUnavailable);
}

TEST(Backoff, waitsLieBetweenHalfAndAllOfTheExponential) {
  Backoff backoff(1, {milliseconds(200), milliseconds(10'000), 2.0});
  for (int n = 0; n < 40; ++n) {
    const double all = std::min(10'000.0, 200.0 * (n < 30 ? 1 << n : 1 << 30));
    EXPECT_EQ(backoff.tries(), static_cast<std::uint32_t>(n));
    const auto wait = static_cast<double>(backoff.next().count());
    EXPECT_GE(wait, 0.5 * all) << n;
    EXPECT_LE(wait, all) << n;
  }
}

TEST(Backoff, resetStartsAgainFromTheFirst) {
  Backoff backoff(1);
  for (int i = 0; i < 10; ++i) (void)backoff.next();
  backoff.reset();
  EXPECT_LE(backoff.next(), milliseconds(200));
}

TEST(Backoff, aSeedAlwaysGivesTheSameWaits) {
  Backoff a(7), b(7);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(a.next(), b.next());
}

TEST(Backoff, aThousandStationsDoNotComeBackTogether) {
  // after 5 failures the waits of 1,000 seeds are spread over 3.2–6.4 s: no interval of 100 ms gets more than
  // twice its share
  std::vector<int> buckets(64, 0);
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    Backoff backoff(seed);
    for (int i = 0; i < 5; ++i) (void)backoff.next();
    ++buckets[static_cast<std::size_t>(backoff.next().count() / 100)];
  }
  EXPECT_LT(*std::max_element(buckets.begin(), buckets.end()), 2 * 1000 / 32);
}

}  // namespace
}  // namespace needlelab
