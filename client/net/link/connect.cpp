#include "client/net/link/connect.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>
#include <vector>

#include <boost/asio/ip/address.hpp>

#include "common/base/time/clock.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

/// Closes the socket (and ends the look-up) when connecting takes too long. The destructor disarms it.
class ConnectDeadline {
 public:
  ConnectDeadline(Tcp::socket& socket, Tcp::resolver& resolver, std::shared_ptr<LinkClock> clock,
                  std::chrono::milliseconds limit)
      : state_(
            std::make_shared<State>(State{&socket, &resolver, asio::steady_timer(socket.get_executor())})) {
    asio::co_spawn(socket.get_executor(), watch(state_, std::move(clock), limit), rethrow);
  }
  ~ConnectDeadline() {
    state_->socket = nullptr;
    state_->timer.cancel();
  }
  ConnectDeadline(const ConnectDeadline&) = delete;
  ConnectDeadline& operator=(const ConnectDeadline&) = delete;
  [[nodiscard]] bool expired() const { return state_->expired; }

 private:
  struct State {
    Tcp::socket* socket;  // null once disarmed
    Tcp::resolver* resolver;
    asio::steady_timer timer;
    bool expired = false;
  };
  static Task<> watch(std::shared_ptr<State> state, std::shared_ptr<LinkClock> clock,
                      std::chrono::milliseconds limit) {
    if (state->socket == nullptr) co_return;
    co_await clock->wait(state->timer, limit, LinkWait::kConnect);
    if (state->socket == nullptr) co_return;
    state->expired = true;
    boost::system::error_code ignored;
    state->socket->close(ignored);
    state->resolver->cancel();
  }

  std::shared_ptr<State> state_;
};

Error unavailable(const Endpoint& server, const std::string& why) {
  return {ErrorCode::kUnavailable, "cannot connect to " + endpointText(server) + ": " + why};
}

/// Uses an address as given and resolves a name. Empty: `limit` has passed.
Task<Result<std::vector<asio::ip::address>>> lookUp(Endpoint server, std::shared_ptr<LinkClock> clock,
                                                    std::chrono::milliseconds limit) {
  using Addresses = std::vector<asio::ip::address>;
  boost::system::error_code no_address;
  const auto address = asio::ip::make_address(server.host, no_address);
  if (!no_address) co_return Addresses{address};
  const auto executor = co_await asio::this_coro::executor;
  Tcp::socket none(executor);
  Tcp::resolver resolver(executor);
  ConnectDeadline deadline(none, resolver, std::move(clock), limit);
  auto [error, found] = co_await resolver.async_resolve(server.host, std::to_string(server.port), kUseTuple);
  if (deadline.expired()) co_return Addresses{};
  if (error) co_return unavailable(server, "the name is not known (" + error.message() + ")");
  Addresses addresses;
  for (const auto& entry : found) addresses.push_back(entry.endpoint().address());
  if (addresses.empty()) co_return unavailable(server, "the name has no address");
  co_return addresses;
}

/// `limit`: for look-up and TCP together.
Task<Result<Tcp::socket>> connectTcp(Endpoint server, std::shared_ptr<LinkClock> clock,
                                     std::chrono::milliseconds limit, ConnectTry& attempt) {
  const auto executor = co_await asio::this_coro::executor;
  const auto tooLong = [&server](std::chrono::milliseconds time) {
    return unavailable(server,
                       fmt::format("no answer within {} ms; is the server running there?", time.count()));
  };
  const std::int64_t started = clock->steadyNs();
  const auto look_up_limit = attempt.others ? std::min(limit, kReachOneOfSeveral) : limit;
  auto found = co_await lookUp(server, clock, look_up_limit);
  if (!found.ok()) co_return found.error();
  if (found->empty()) co_return tooLong(look_up_limit);
  const std::chrono::nanoseconds spent(clock->steadyNs() - started);
  auto left = limit - std::chrono::duration_cast<std::chrono::milliseconds>(spent);
  if (attempt.choose) *found = {attempt.choose(*found)};
  if (attempt.others && left > kReachOneOfSeveral) left = limit = kReachOneOfSeveral;

  Tcp::socket socket(executor);
  Tcp::resolver none(executor);
  ConnectDeadline deadline(socket, none, std::move(clock), std::max(left, std::chrono::milliseconds(1)));
  std::string why;
  for (const asio::ip::address& address : *found) {
    boost::system::error_code ignored;
    socket.close(ignored);
    auto [error] = co_await socket.async_connect(Tcp::endpoint(address, server.port), kUseTuple);
    if (deadline.expired()) co_return tooLong(limit);
    if (!error) co_return socket;
    why = error.message();
  }
  co_return unavailable(server, why);
}

/// Returns the next message that is not a Ping; a Refusal or Bye returns its error.
Task<Result<pb::Envelope>> receiveAnswer(std::shared_ptr<Channel> channel, const LinkClock& clock,
                                         pb::Refusal::Reason& refused) {
  for (;;) {
    auto got = co_await channel->receive();
    if (!got.ok()) co_return got.error();
    if (got->has_refusal()) {
      refused = got->refusal().reason();
      co_return errorOf(got->refusal());
    }
    if (got->has_bye())
      co_return Error{ErrorCode::kUnavailable, "the server said bye: " + got->bye().reason()};
    if (!got->has_ping()) co_return got;
    channel->send(pongTo(got->ping(), clock.steadyNs()));
  }
}

/// Advice for a certificate that we do not accept.
Error certificateRefused(long verdict, const Endpoint& server, const Error& why) {
  const std::string whose = "the server at " + endpointText(server);
  switch (verdict) {
    case X509_V_ERR_HOSTNAME_MISMATCH:
    case X509_V_ERR_IP_ADDRESS_MISMATCH:
      return {ErrorCode::kDenied, whose + ": " + kNotForThisName + " '" + server.host +
                                      "'; give --server a name that the certificate has, or start the server "
                                      "with --host-name " +
                                      server.host};
    case X509_V_ERR_UNABLE_TO_GET_ISSUER_CERT_LOCALLY:
    case X509_V_ERR_SELF_SIGNED_CERT_IN_CHAIN:
    case X509_V_ERR_DEPTH_ZERO_SELF_SIGNED_CERT:
    case X509_V_ERR_CERT_SIGNATURE_FAILURE:
      return {ErrorCode::kDenied, whose +
                                      ": its certificate is not signed by the CA of --ca; is that the "
                                      "tls/ca.crt of this server, and is this the server?"};
    default:
      return why;
  }
}

Task<Result<ClientConnection>> greetAndLogIn(std::shared_ptr<Channel> channel, ClientConfig config,
                                             const LinkClock& clock, pb::Refusal::Reason& refused) {
  // greeting
  pb::Envelope hello;
  *hello.mutable_hello()->mutable_version() = config.version;
  hello.mutable_hello()->set_program(config.program);
  channel->send(hello);
  auto greeted = co_await receiveAnswer(channel, clock, refused);
  if (!greeted.ok()) co_return greeted.error();
  if (!greeted->has_hello())
    co_return Error{ErrorCode::kCorrupt, "the peer did not greet; is it a needlelab-server?"};
  if (auto fits = checkVersion(config.version, greeted->hello().version()); !fits.ok())
    co_return fits.error();

  // log-in
  pb::Envelope login;
  *login.mutable_login() = config.login;
  channel->send(login);
  auto welcomed = co_await receiveAnswer(channel, clock, refused);
  if (!welcomed.ok()) co_return welcomed.error();
  if (!welcomed->has_welcome())
    co_return Error{ErrorCode::kCorrupt, "the server answered the log-in with something else"};
  channel->established();
  co_return ClientConnection{channel, welcomed->welcome(), greeted->hello()};
}

}  // namespace

std::int64_t LinkClock::unixNs() const {
  return wallNowNs();
}

Task<> LinkClock::wait(asio::steady_timer& timer, std::chrono::milliseconds time, LinkWait /*what*/) {
  timer.expires_after(time);
  co_await timer.async_wait(kUseTuple);
}

void LinkClock::runOne(asio::io_context& io, std::int64_t due_ns) {
  constexpr std::int64_t kLongest_ns = 1'000'000'000;  // due_ns may be INT64_MAX: avoids overflow
  io.run_one_for(std::chrono::nanoseconds(std::min(due_ns - steadyNs(), kLongest_ns)));
}

pb::Login stationLogin(const std::string& station, const std::string& key) {
  pb::Login login;
  login.mutable_station()->set_station(station);
  login.mutable_station()->set_key(key);
  return login;
}

pb::Login personLogin(const std::string& user, const std::string& password) {
  pb::Login login;
  login.mutable_person()->set_user(user);
  login.mutable_person()->set_password(password);
  return login;
}

pb::Envelope pongTo(const pb::Ping& ping, std::int64_t now_ns) {
  pb::Envelope envelope;
  pb::Pong& pong = *envelope.mutable_pong();
  pong.set_id(ping.id());
  pong.set_sender_steady_ns(ping.sender_steady_ns());
  pong.set_receiver_steady_ns(now_ns);
  return envelope;
}

void ClientConfig::setServers(const Endpoints& all) {
  server = all.front();
  others.assign(all.begin() + 1, all.end());
}

Endpoints ClientConfig::servers() const {
  Endpoints all{server};
  all.insert(all.end(), others.begin(), others.end());
  return all;
}

Task<Result<ClientConnection>> connectClient(ClientConfig config, std::shared_ptr<LinkClock> clock,
                                             ConnectTry* attempt) {
  if (!config.tls) {
    auto tls = makeClientTls(config.ca_file);
    if (!tls.ok()) co_return tls.error();
    config.tls = *tls;
  }
  ConnectTry unseen;
  ConnectTry& seen = attempt != nullptr ? *attempt : unseen;
  const std::int64_t started = clock->steadyNs();
  auto socket =
      co_await connectTcp(config.server, clock, std::min(config.connect_timeout, config.reach_timeout), seen);
  if (!socket.ok()) co_return socket.error();
  seen.reached = true;
  if (seen.others) config.connect_timeout = std::min(config.connect_timeout, kConnectOneOfSeveral);

  TlsStream stream(std::move(*socket), *config.tls);
  if (auto named = requireHost(stream, config.server.host); !named.ok()) co_return named.error();
  // the rest of the time is for TLS and log-in; the server is verified, so it may send long messages now
  const std::chrono::nanoseconds spent(clock->steadyNs() - started);
  const auto left = config.connect_timeout - std::chrono::duration_cast<std::chrono::milliseconds>(spent);
  config.limits.handshake_timeout = std::max(left, std::chrono::milliseconds(1));
  config.limits.frame_bytes = kMaxFrameBytes;
  auto channel = Channel::make(std::move(stream), config.limits);
  auto shaken = co_await channel->handshake(asio::ssl::stream_base::client);
  if (!shaken.ok()) {
    if (shaken.error().code == ErrorCode::kDenied)
      co_return certificateRefused(SSL_get_verify_result(channel->ssl()), config.server, shaken.error());
    co_return shaken.error();
  }

  auto connection = co_await greetAndLogIn(channel, config, *clock, seen.refused);
  if (!connection.ok()) channel->finish(CloseReason::kLocal, connection.error().message);
  co_return connection;
}

}  // namespace needlelab
