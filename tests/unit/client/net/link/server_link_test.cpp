#include "client/net/link/server_link.h"

#include <gmock/gmock.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <filesystem>
#include <mutex>
#include <optional>

#include "tests/support/patience.h"
#include "tests/unit/client/net/link/scripted_server.h"

namespace needlelab {
namespace {

using namespace test;
using std::chrono::milliseconds;
using testing::HasSubstr;

// --- the link, on a simulated clock that the test moves

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
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!so()) {
      if (std::chrono::steady_clock::now() > end) return false;
      io_.restart();
      io_.run_for(milliseconds(2));
    }
    return true;
  }
  /// Runs the link for some turns; nothing it waits for arrives.
  void settle() {
    io_.restart();
    io_.run_for(milliseconds(30));
  }
  bool online() {
    return until([&] { return link_->online(); });
  }
  bool connects(const ScriptedServer& server) {
    makeLink();
    link_->logIn(server.config());
    return online();
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
  const ClosedPort closed;
  config.server.port = closed.port();
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

TEST_F(ServerLinkTest, aProbedServerIsRetriedWithinTheLimitAndFound) {
  ScriptedServer server(friendly);
  auto config = server.config();
  const std::uint16_t listening = config.server.port;
  const ClosedPort closed;
  config.server.port = closed.port();
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

TEST_F(ServerLinkTest, aSilentServerWasReachedAndIsRetriedEverMoreSeldom) {
  asio::io_context other;
  Tcp::acceptor silent(other, Tcp::endpoint(asio::ip::address_v4::loopback(), 0));
  ScriptedServer server(friendly);
  auto config = server.config();
  config.server.port = silent.local_endpoint().port();
  config.connect_timeout = milliseconds(50);  // the channel's time is real
  makeLink();
  link_->logIn(config);
  Backoff same(7, {milliseconds(200), milliseconds(10'000), 2.0});
  std::vector<milliseconds> waits;
  for (std::size_t n = 1; n <= 7; ++n) {
    ASSERT_TRUE(away(n));
    EXPECT_FALSE(ends_.back().was_connected);
    EXPECT_TRUE(ends_.back().reached);
    EXPECT_THAT(ends_.back().error.message, HasSubstr("no log-in within"));
    settle();
    waits.push_back(same.next());
    ASSERT_EQ(clock_->asked, waits);
    clock_->advance(waits.back());
  }
}

/// Its accept queue is full: the kernel does not answer the next SYN.
class DeafPort {
 public:
  DeafPort() : acceptor_(io_, Tcp::v4()) {
    acceptor_.bind({asio::ip::address_v4::loopback(), 0});
    acceptor_.listen(0);
    for (Tcp::socket& each : waiting_) {
      each.open(Tcp::v4());
      each.native_non_blocking(true);
      const Tcp::endpoint here = acceptor_.local_endpoint();
      (void)::connect(each.native_handle(), here.data(), static_cast<socklen_t>(here.size()));
    }
  }
  [[nodiscard]] std::uint16_t port() const { return acceptor_.local_endpoint().port(); }

 private:
  asio::io_context io_;
  Tcp::acceptor acceptor_;
  std::array<Tcp::socket, 4> waiting_{Tcp::socket(io_), Tcp::socket(io_), Tcp::socket(io_), Tcp::socket(io_)};
};

TEST_F(ServerLinkTest, anUnansweringAddressIsAbandonedAtTheLimitAndProbesEarlier) {
  ScriptedServer server(friendly);
  const DeafPort deaf;
  auto config = server.config();
  config.server.port = deaf.port();
  config.connect_timeout = config.reach_timeout = milliseconds(5000);
  makeLink();
  retry_ = Retry::kProbe;
  link_->logIn(config);
  for (const milliseconds limit : {milliseconds(5000), Backoff::Settings{}.probe}) {
    const std::size_t before = ends_.size();
    settle();
    clock_->advance(limit - milliseconds(1));
    settle();
    EXPECT_EQ(ends_.size(), before) << "too early";
    clock_->advance(milliseconds(1));
    ASSERT_TRUE(away(before + 1));
    EXPECT_FALSE(ends_.back().reached);
    EXPECT_THAT(ends_.back().error.message, HasSubstr("no answer within " + std::to_string(limit.count())));
    settle();
    clock_->advance(clock_->asked.back());
  }
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
    EXPECT_FALSE(ends_.back().is_server_reason);
    waits.push_back(same.next());
    EXPECT_EQ(clock_->asked, waits) << "a connection that is lost at once is not a success";
    clock_->advance(waits.back());
    ASSERT_TRUE(online());
    // the third lasts just too short, the fourth 1 ms longer
    if (times >= 3) clock_->advance(milliseconds(times == 3 ? 10'000 : 10'001));
  }
  ASSERT_TRUE(lose(5));
  same.reset();
  waits.push_back(same.next());
  EXPECT_EQ(clock_->asked, waits);
  EXPECT_LE(clock_->asked.back(), milliseconds(200));
  EXPECT_EQ(link_->connections(), 5u);
}

TEST_F(ServerLinkTest, aManualLinkReconnectsOnRequestAfterItsBackOff) {
  ScriptedServer server(friendly);
  ASSERT_TRUE(connects(server));
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
    return answer ? std::vector{doneWith(got.request())} : std::vector<pb::Envelope>{};
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
  ASSERT_TRUE(connects(server));
  std::optional<Result<pb::Reply>> reply;
  link_->ask(
      listUsers(), [&](Result<pb::Reply> got) { reply.emplace(std::move(got)); }, OnLoss::kResend,
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

TEST_F(ServerLinkTest, aRefusingServerIsRetriedByTheOwnersPolicy) {
  std::atomic<bool> deny{true};
  ScriptedServer server(friendlyUnless(deny));
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
  ASSERT_TRUE(connects(server));
  pb::Envelope bye;
  bye.mutable_bye()->set_reason("moving house");
  server.broadcast(bye);
  ASSERT_TRUE(away(1));
  EXPECT_TRUE(ends_.back().is_server_reason);
  EXPECT_THAT(ends_.back().error.message, HasSubstr("moving house"));
  EXPECT_THAT(ends_.back().channel_text, HasSubstr("moving house"));
  EXPECT_EQ(messages_.size(), 1u);
}

TEST_F(ServerLinkTest, pingsAreAnsweredAndOtherMessagesHandedOver) {
  ScriptedServer server(friendly);
  ASSERT_TRUE(connects(server));
  pb::Envelope ping, message, late;
  ping.mutable_ping()->set_id(5);
  message.mutable_trainee_message()->set_text("slower");
  late.mutable_reply()->set_id(77);  // its caller no longer waits
  for (const auto& each : {ping, message, late}) server.broadcast(each);
  ASSERT_TRUE(until([&] { return messages_.size() == 2; }));
  const auto isOurTime = [this](const pb::Envelope& e) {
    return e.has_pong() && e.pong().receiver_steady_ns() == clock_->steadyNs();
  };
  ASSERT_TRUE(until([&] { return server.count(isOurTime) == 1; }));
  EXPECT_THAT(messages_[0], HasSubstr("slower"));
}

TEST_F(ServerLinkTest, stopSaysByeAndADestroyedOwnerGetsNoCallbacks) {
  ScriptedServer server(friendly);
  ASSERT_TRUE(connects(server));
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

  // The next link is destroyed while connected, another one while connecting.
  ends_.clear();
  ASSERT_TRUE(connects(server));
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
  ASSERT_TRUE(connects(server));
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

// --- several servers

/// Two servers of one lab; the link's list begins with the first.
class ServerLinkOfTwo : public ServerLinkTest {
 protected:
  void connectTo(const Endpoints& servers) {
    auto config = first_.config();
    config.setServers(servers);
    makeLink();
    link_->logIn(config);
  }
  [[nodiscard]] Endpoint first() const { return {"127.0.0.1", first_.port()}; }
  [[nodiscard]] Endpoint second() const { return {"127.0.0.1", second_.port()}; }
  [[nodiscard]] bool isAt(const Endpoint& server) {
    return online() && sameEndpoint(link_->server(), server);
  }

  /// A script that a test may change while the server runs.
  class Says {
   public:
    void operator=(ScriptedServer::Script script) {
      const std::scoped_lock lock(mutex_);
      script_ = std::move(script);
    }
    std::vector<pb::Envelope> answer(const pb::Envelope& got) {
      const std::scoped_lock lock(mutex_);
      return script_(got);
    }

   private:
    std::mutex mutex_;
    ScriptedServer::Script script_ = friendly;
  };
  const ClosedPort closed_;
  Says first_says_, second_says_;
  ScriptedServer first_{[this](const pb::Envelope& got) { return first_says_.answer(got); }};
  ScriptedServer second_{[this](const pb::Envelope& got) { return second_says_.answer(got); }, first_.files};
};

ScriptedServer::Script refusing(pb::Refusal::Reason reason) {
  return [reason](const pb::Envelope& got) {
    pb::Envelope no;
    *no.mutable_refusal() = makeRefusal(reason, "so says the test", true);
    return got.has_login() ? std::vector{no} : friendly(got);
  };
}

TEST_F(ServerLinkOfTwo, aDeadServerIsPassedOverWithoutAWait) {
  const Endpoint dead{"127.0.0.1", closed_.port()};
  connectTo({dead, second()});
  ASSERT_TRUE(isAt(second()));
  EXPECT_TRUE(ends_.empty());
  EXPECT_TRUE(clock_->asked.empty());
  EXPECT_THAT(link_->passedOver(), HasSubstr(endpointText(dead)));
}

TEST_F(ServerLinkOfTwo, afterALossTheOtherIsTriedAfterTheFirstWait) {
  connectTo({first(), second()});
  Backoff same(7, {milliseconds(200), milliseconds(10'000), 2.0});
  ASSERT_TRUE(isAt(first()));
  EXPECT_TRUE(link_->passedOver().empty());
  first_.dropConnections();
  ASSERT_TRUE(away(1));
  EXPECT_TRUE(ends_.back().others);
  EXPECT_EQ(ends_.back().server, endpointText(first()));
  settle();
  const milliseconds wait = same.next();
  EXPECT_EQ(clock_->asked, std::vector{wait});
  clock_->advance(wait);
  ASSERT_TRUE(isAt(second())) << "the first is there, but the second has not failed";
  EXPECT_EQ(first_.logins(), 1u);
  // and back
  second_.dropConnections();
  ASSERT_TRUE(away(2));
  settle();
  clock_->advance(same.next());
  EXPECT_TRUE(isAt(first()));
}

TEST_F(ServerLinkOfTwo, aRoundThroughAllBacksOffAndReportsEachOutcome) {
  const ClosedPort another;
  const Endpoint dead{"127.0.0.1", closed_.port()}, gone{"127.0.0.1", another.port()};
  connectTo({dead, gone});
  // usually their database keeps both from serving, and it comes back for both at once
  Backoff same(7, {milliseconds(200), milliseconds(4'000), 2.0});
  for (std::size_t n = 1; n <= 8; ++n) {
    ASSERT_TRUE(away(n));
    EXPECT_EQ(ends_.back().error.code, ErrorCode::kUnavailable);
    EXPECT_FALSE(ends_.back().reached);
    EXPECT_THAT(ends_.back().error.message,
                HasSubstr("no server takes us: cannot connect to " + endpointText(dead)));
    EXPECT_THAT(ends_.back().error.message, HasSubstr("; cannot connect to " + endpointText(gone)));
    EXPECT_EQ(ends_.back().server, endpointsText({dead, gone}));
    settle();
    const milliseconds wait = same.next();
    ASSERT_EQ(clock_->asked.size(), n) << "one wait a round";
    EXPECT_EQ(clock_->asked.back(), wait);
    clock_->advance(wait);
  }
}

TEST_F(ServerLinkOfTwo, aSwallowedSynKeepsItFromTheOtherForSoLongOnly) {
  const DeafPort deaf;
  connectTo({{"127.0.0.1", deaf.port()}, second()});
  settle();
  clock_->advance(kReachOneOfSeveral - milliseconds(1));
  settle();
  EXPECT_FALSE(link_->online());
  EXPECT_EQ(second_.logins(), 0u);
  clock_->advance(milliseconds(1));
  ASSERT_TRUE(isAt(second()));
  EXPECT_THAT(link_->passedOver(), HasSubstr("no answer within 1500 ms"));
}

TEST_F(ServerLinkOfTwo, aServerThatAcceptsAndStaysSilentIsSkipped) {
  asio::io_context other;
  Tcp::acceptor silent(other, Tcp::endpoint(asio::ip::address_v4::loopback(), 0));
  auto config = first_.config();
  config.setServers({{"127.0.0.1", silent.local_endpoint().port()}, second()});
  config.connect_timeout = kConnectOneOfSeveral;  // the channel's time is real
  makeLink();
  link_->logIn(config);
  ASSERT_TRUE(isAt(second()));
  EXPECT_TRUE(ends_.empty());
}

TEST_F(ServerLinkOfTwo, aWrongPasswordIsNotTriedAtTheOther) {
  first_says_ = refusing(pb::Refusal::LOGIN);
  connectTo({first(), second()});
  retry_ = Retry::kSlowly;
  for (std::size_t n = 1; n <= 3; ++n) {
    ASSERT_TRUE(away(n));
    EXPECT_EQ(ends_.back().error.code, ErrorCode::kDenied);
    EXPECT_EQ(ends_.back().server, endpointText(first()));
    EXPECT_THAT(ends_.back().error.message, HasSubstr(endpointText(first()) + ": the peer refused (LOGIN)"));
    settle();
    clock_->advance(milliseconds(10'000));
  }
  EXPECT_EQ(second_.logins(), 0u);
}

TEST_F(ServerLinkOfTwo, whatIsAboutOneServerGoesToTheOther) {
  std::size_t refused = 0;
  for (const auto reason : {pb::Refusal::SHUTTING_DOWN, pb::Refusal::NO_ROOM, pb::Refusal::INTERNAL,
                            pb::Refusal::CONFLICT, pb::Refusal::TIMEOUT, pb::Refusal::VERSION}) {
    first_says_ = refusing(reason);
    connectTo({first(), second()});
    ASSERT_TRUE(isAt(second())) << pb::Refusal::Reason_Name(reason);
    EXPECT_EQ(first_.logins(), ++refused);
    EXPECT_THAT(link_->passedOver(), HasSubstr(endpointText(first()) + ": "));
    link_.reset();
  }
  EXPECT_TRUE(ends_.empty());
}

TEST_F(ServerLinkOfTwo, aLockedOutPersonWaitsAndACrowdedOutStationContinues) {
  first_says_ = refusing(pb::Refusal::RATE_LIMITED);
  connectTo({first(), second()});
  for (std::size_t n = 1; n <= 3; ++n) {
    ASSERT_TRUE(away(n));
    EXPECT_EQ(ends_.back().error.code, ErrorCode::kUnavailable);
    settle();
    clock_->advance(clock_->asked.back());
  }
  EXPECT_EQ(second_.logins(), 0u);
  auto config = first_.config();
  config.setServers({first(), second()});
  config.login = stationLogin("bench-1", std::string(32, 'k'));
  link_->logIn(config);
  EXPECT_TRUE(isAt(second()));
}

TEST_F(ServerLinkOfTwo, aServerWithAnotherCertificateIsPassedOverAndHearsNoPassword) {
  ScriptedServer stranger(friendly);
  connectTo({{"127.0.0.1", stranger.port()}, second()});
  ASSERT_TRUE(isAt(second()));
  EXPECT_TRUE(stranger.received().empty());
  EXPECT_THAT(link_->passedOver(), HasSubstr("not signed by the CA"));
}

// one authority, one certificate per server: each name is checked in the certificate that its server presents
TEST_F(ServerLinkOfTwo, theCertificateMustBeForTheNameThatWasAsked) {
  const TempFolder folder;
  const TlsFiles files = tlsFilesIn(folder.path());
  std::filesystem::copy_file(first_.files.ca_certificate, files.ca_certificate);
  std::filesystem::copy_file(first_.files.ca_key, files.ca_key);
  ASSERT_TRUE(ensureTlsFiles(files, {{"localhost"}}).ok());
  ScriptedServer third(friendly, files);
  connectTo({{"127.0.0.1", third.port()}, {"localhost", third.port()}});
  ASSERT_TRUE(isAt({"localhost", third.port()}));
  EXPECT_THAT(link_->passedOver(), HasSubstr(std::string(kNotForThisName) + " '127.0.0.1'"));
  EXPECT_EQ(third.logins(), 1u);
}

TEST_F(ServerLinkOfTwo, aTokenGoesAlongAndThePasswordFollowsAtTheSameServer) {
  const std::int64_t until_ns = clock_->unixNs() + 60'000'000'000;
  first_says_ = [until_ns](const pb::Envelope& got) {
    auto answers = friendly(got);
    if (got.has_login()) {
      answers[0].mutable_welcome()->set_token("t1");
      answers[0].mutable_welcome()->set_token_expires_unix_ns(until_ns);
    }
    return answers;
  };
  second_says_ = [](const pb::Envelope& got) {
    return got.has_login() && got.login().has_token() ? refusing(pb::Refusal::LOGIN)(got) : friendly(got);
  };
  connectTo({first(), second()});
  ASSERT_TRUE(isAt(first()));
  first_.dropConnections();
  ASSERT_TRUE(away(1));
  settle();
  clock_->advance(milliseconds(200));
  ASSERT_TRUE(isAt(second()));
  EXPECT_EQ(second_.logins(), 2u) << "the token, and at once the password";
  EXPECT_EQ(first_.logins(), 1u);
  EXPECT_EQ(ends_.size(), 1u);
}

// When servers die one after the other, the next one must not wait. If a server gives a reason for ending the
// connection (CONFLICT: two stations with one key), the waits grow.
TEST_F(ServerLinkOfTwo, twoSecondsOnlineResetTheBackOffUnlessRefused) {
  connectTo({first(), second()});
  Backoff same(7, {milliseconds(200), milliseconds(10'000), 2.0});
  std::size_t losses = 0;
  const auto lose = [&](ScriptedServer& server, milliseconds lasted, bool says_why) {
    if (!online()) return false;
    clock_->advance(lasted);
    pb::Envelope no;
    *no.mutable_refusal() = makeRefusal(pb::Refusal::CONFLICT, "logged in again", true);
    if (says_why) {
      server.broadcast(no);
      if (!until([&] { return !link_->online(); })) return false;
    }
    server.dropConnections();
    if (!away(++losses)) return false;
    settle();
    return true;
  };
  std::vector<milliseconds> waits;
  const auto expectWait = [&] {
    waits.push_back(same.next());
    EXPECT_EQ(clock_->asked, waits);
    clock_->advance(waits.back());
  };
  ASSERT_TRUE(lose(first_, milliseconds(2000), false));
  expectWait();
  ASSERT_TRUE(lose(second_, milliseconds(2001), false));
  same.reset();
  expectWait();
  ASSERT_TRUE(lose(first_, milliseconds(2001), true));
  expectWait();
  ASSERT_TRUE(lose(second_, milliseconds(10'000), true));
  expectWait();
  ASSERT_TRUE(lose(first_, milliseconds(10'001), true));
  same.reset();
  expectWait();
}

// it promises a message every 100 ms and sends nothing: it hangs, or the network is cut
TEST_F(ServerLinkOfTwo, aSilentServerIsLeftOnlyForAnother) {
  first_says_ = [](const pb::Envelope& got) {
    auto answers = friendly(got);
    if (got.has_login()) answers[0].mutable_welcome()->set_keepalive_ms(100);
    return answers;
  };
  connectTo({first()});
  ASSERT_TRUE(isAt(first()));
  const auto end = std::chrono::steady_clock::now() + milliseconds(800);
  ASSERT_TRUE(until([&] { return !ends_.empty() || std::chrono::steady_clock::now() > end; }));
  EXPECT_TRUE(ends_.empty()) << "there is nowhere else to go: 30 s";
  connectTo({first(), second()});
  ASSERT_TRUE(isAt(first()));
  ASSERT_TRUE(away(1));
  EXPECT_THAT(ends_.back().channel_text, HasSubstr("nothing received for 300 ms"));
  settle();
  clock_->advance(milliseconds(200));
  EXPECT_TRUE(isAt(second()));
}

TEST_F(ServerLinkOfTwo, itMovesOnOnceAndNotBackWithinAMinute) {
  connectTo({first(), second()});
  ASSERT_TRUE(isAt(first()));
  ASSERT_TRUE(link_->moveOn("no room"));
  ASSERT_TRUE(away(1));
  EXPECT_THAT(ends_.back().channel_text, HasSubstr("no room"));
  ASSERT_TRUE(until([&] {
    return first_.count([](const auto& e) { return e.has_bye() && e.bye().reason() == "no room"; }) == 1;
  }));
  settle();
  clock_->advance(milliseconds(200));
  ASSERT_TRUE(isAt(second()));
  EXPECT_FALSE(link_->moveOn("no room")) << "the first was left just now";
  clock_->advance(milliseconds(60'000));
  EXPECT_TRUE(link_->moveOn("no room"));
}

TEST_F(ServerLinkTest, theOnlyServerIsNeverLeft) {
  ScriptedServer server(friendly);
  ASSERT_TRUE(connects(server));
  EXPECT_FALSE(link_->moveOn("no room"));
  EXPECT_TRUE(link_->online());
  EXPECT_TRUE(link_->passedOver().empty());
}

// --- its waits

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
