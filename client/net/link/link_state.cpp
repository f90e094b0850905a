// How a ServerLink connects, serves its connection, waits for the next try, and answers requests.
#include "client/net/link/link_state.h"

#include <algorithm>
#include <map>
#include <utility>

#include "common/base/time/clock.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

constexpr std::chrono::milliseconds kDeadlinePoll{250};

std::uint64_t seedNow() {
  return static_cast<std::uint64_t>(wallNowNs()) ^ static_cast<std::uint64_t>(steadyNowNs()) << 20;
}

/// Whether all servers of a lab would give this refusal. RATE_LIMITED tells people that they guessed too
/// often or have too many connections, and a station that the server has no place.
bool isSharedRefusal(pb::Refusal::Reason reason, bool to_person) {
  switch (reason) {
    case pb::Refusal::LOGIN:
    case pb::Refusal::ROLE:
    case pb::Refusal::INVALID:
    case pb::Refusal::TOO_LARGE:
    case pb::Refusal::NOT_FOUND:
      return true;
    case pb::Refusal::RATE_LIMITED:
      return to_person;
    default:
      return false;
  }
}

/// Errors of a round by the server's number in the list.
using RoundErrors = std::map<std::size_t, Error>;

std::string textOf(const RoundErrors& errors) {
  std::string text;
  for (const auto& [number, error] : errors) text += (text.empty() ? "" : "; ") + error.message;
  return text;
}

/// The error if no server accepted us: they are unreachable, unless all failed in the same way.
Error errorOf(const RoundErrors& errors) {
  if (errors.size() == 1) return errors.begin()->second;
  ErrorCode code = errors.begin()->second.code;
  for (const auto& [number, error] : errors)
    if (error.code != code) code = ErrorCode::kUnavailable;
  return {code, "no server takes us: " + textOf(errors)};
}

Error connectionLostError(const std::string& why) {
  return {ErrorCode::kUnavailable,
          why + ": the answer did not come; look whether it happened before you do it again"};
}

}  // namespace

ServerLinkState::ServerLinkState(asio::io_context& context, LinkSettings chosen, LinkHandlers given)
    : io(context),
      settings(std::move(chosen)),
      handlers(std::move(given)),
      seed(settings.seed != 0 ? settings.seed : seedNow()),
      backoff(seed, settings.retry),
      reconnects(settings.reconnects) {}

Task<> ServerLinkState::run(std::shared_ptr<ServerLinkState> self) {
  ServerLinkState& me = *self;
  while (!me.stopping) {
    if (!me.config) {
      co_await me.settings.clock->wait(me.nap, kLinkForever, LinkWait::kRetry);
      continue;
    }
    const std::uint64_t number = me.login_number;
    LinkEnd end;
    auto connection = co_await me.connectToAny(end, number);
    if (me.stopping || number != me.login_number) {
      if (connection.ok()) connection->channel->finish(CloseReason::kLocal, "another log-in");
      continue;
    }
    if (!connection.ok()) {
      end.error = connection.error();
    } else {
      const std::int64_t connected_ns = me.settings.clock->steadyNs();
      const std::shared_ptr<ServerChoice> places = me.choice;
      co_await me.serve(std::move(*connection));
      // the queued messages (our Bye) must still go out; the channel limits the time
      co_await me.channel->untilClosed();
      places->lost();
      end.was_connected = true;
      end.others = places->hasOther();
      end.server = endpointText(me.server);
      end.is_server_reason = me.server_reason.has_value();
      end.error = me.server_reason.value_or(*me.ended);
      end.channel_text = me.channel->closeText();
      me.ended = end.error;
      me.channel.reset();
      me.server_reason.reset();
      me.fail(connectionLostError(end.is_server_reason ? end.error.message
                                                       : "the connection is lost: " + end.channel_text),
              [](const Waiting& one) { return one.on_loss == OnLoss::kGiveUp; });
      const std::int64_t lasted_ns = me.settings.clock->steadyNs() - connected_ns;
      const bool is_short = end.others && !end.is_server_reason;
      const auto lasting =
          is_short ? std::min(me.settings.lasting, me.settings.lasting_of_several) : me.settings.lasting;
      if (lasted_ns > nanoseconds(lasting)) me.backoff.reset();
      if (number != me.login_number && !me.stopping) continue;
    }
    co_await me.waitForNextTry(end, number);
  }
  me.running = false;
  if (me.stopped && !me.abandoned) me.stopped();
}

// one round
Task<Result<ClientConnection>> ServerLinkState::connectToAny(LinkEnd& end, std::uint64_t number) {
  const std::shared_ptr<ServerChoice> places = choice;
  const Endpoints servers = config->servers();
  end.server = endpointsText(servers);
  TlsContext tls = config->tls;
  if (!tls) {
    auto made = makeClientTls(config->ca_file);
    if (!made.ok()) co_return made.error();
    tls = std::move(*made);
  }
  RoundErrors errors;
  places->beginRound();
  while (const Endpoint* const next = places->next()) {
    ClientConfig chosen = *config;
    chosen.server = *next;
    chosen.tls = tls;
    ConnectTry attempt;
    attempt.others = places->several();
    attempt.choose = [&attempt, &places](const std::vector<asio::ip::address>& found) {
      const auto address = places->take(found);
      attempt.others = places->several();
      return address;
    };
    auto connection = co_await connect(std::move(chosen), number, attempt);
    end.reached = end.reached || attempt.reached;
    if (stopping || number != login_number) co_return connection;
    const auto is_next = [next](const Endpoint& each) { return sameEndpoint(each, *next); };
    const auto which =
        static_cast<std::size_t>(std::find_if(servers.begin(), servers.end(), is_next) - servers.begin());
    if (connection.ok()) {
      places->welcomed();
      server = *next;
      errors.erase(which);
      passed_over = servers.size() > 1 ? textOf(errors) : std::string();
      co_return connection;
    }
    Error error = connection.error();
    const std::string name = endpointText(*next);
    if (servers.size() > 1 && error.message.find(name) == std::string::npos)
      error.message = name + ": " + error.message;
    if (isSharedRefusal(attempt.refused, config->login.has_person())) {
      places->refused();
      end.server = name;
      co_return error;
    }
    places->failed();
    errors.insert_or_assign(which, std::move(error));
  }
  co_return errorOf(errors);
}

// at one place
Task<Result<ClientConnection>> ServerLinkState::connect(ClientConfig chosen, std::uint64_t number,
                                                        ConnectTry& attempt) {
  // do not wait long for the answer to a probe's SYN: the next probe follows
  if (probing) chosen.reach_timeout = std::min(chosen.reach_timeout, settings.retry.probe);
  const bool by_token = !token.empty() && token_until_unix_ns > settings.clock->unixNs();
  ClientConfig first = chosen;
  if (by_token) first.login.set_token(token);
  auto connection = co_await connectClient(std::move(first), settings.clock, &attempt);
  if (by_token && attempt.refused == pb::Refusal::LOGIN && !stopping && number == login_number) {
    // the server has restarted and does not know its old tokens: use the password at once
    token.clear();
    attempt.refused = pb::Refusal::REASON_UNSPECIFIED;
    connection = co_await connectClient(std::move(chosen), settings.clock, &attempt);
  }
  if (connection.ok() && handlers.accept && !abandoned) {
    if (const Status accepted = handlers.accept(connection->welcome); !accepted.ok()) {
      connection->channel->finish(CloseReason::kLocal, accepted.error().message);
      attempt.refused = pb::Refusal::ROLE;
      co_return accepted.error();
    }
  }
  co_return connection;
}

Task<> ServerLinkState::serve(ClientConnection connection) {
  channel = std::move(connection.channel);
  welcome = std::move(connection.welcome);
  server_reason.reset();
  ended.reset();
  token = welcome.token();
  token_until_unix_ns = welcome.token_expires_unix_ns();
  ++connections;
  // leave a server that is paused or unreachable while another one may still help
  const std::chrono::milliseconds silence = 3 * std::chrono::milliseconds(welcome.keepalive_ms());
  if (silence.count() > 0 && silence < channel->limits().idle_timeout && choice->hasOther())
    channel->setIdleTimeout(silence);
  for (const auto& [id, one] : waiting) sendRequest(id, one);
  if (handlers.connected && !abandoned) handlers.connected(welcome);
  for (;;) {
    if (read_pause.count() > 0) {
      asio::steady_timer timer(io);
      co_await settings.clock->wait(timer, std::exchange(read_pause, std::chrono::milliseconds(0)),
                                    LinkWait::kRequest);
    }
    auto got = co_await channel->receive();
    if (!got.ok()) {
      ended = got.error();
      // tells the peer the reason if its bytes were at fault
      channel->finish(CloseReason::kProtocol, got.error().message);
      co_return;
    }
    take(std::move(*got));
  }
}

Task<> ServerLinkState::waitForNextTry(LinkEnd& end, std::uint64_t number) {
  end.stopping = stopping;
  if (end.error.code == ErrorCode::kDenied) token.clear();
  const Retry retry = handlers.judge && !abandoned ? handlers.judge(end) : Retry::kBackOff;
  std::chrono::milliseconds time = kLinkForever;
  if (retry == Retry::kSlowly) time = settings.retry.most;
  if (retry == Retry::kBackOff && reconnects)
    time = choice && choice->several() ? backoff.next(settings.max_of_several) : backoff.next();
  probing = retry == Retry::kProbe;
  if (probing && reconnects) time = backoff.nextProbe();
  if (!reconnects) time = kLinkForever;
  if (time != kLinkForever && !stopping) end.next_try_ns = settings.clock->steadyNs() + nanoseconds(time);
  ended = end.error;
  if (handlers.away && !abandoned) handlers.away(end);
  if (stopping || number != login_number) co_return;
  const bool parked = !reconnects;
  co_await settings.clock->wait(nap, time, LinkWait::kRetry);
  // woken by reconnect(true): do the skipped wait now
  if (parked && reconnects && !stopping && number == login_number)
    co_await settings.clock->wait(nap, backoff.next(), LinkWait::kRetry);
}

// fails requests that have waited too long
Task<> ServerLinkState::watchDeadlines(std::shared_ptr<ServerLinkState> self) {
  ServerLinkState& me = *self;
  asio::steady_timer timer(me.io);
  while (!me.waiting.empty() && !me.stopping) {
    co_await me.settings.clock->wait(timer, kDeadlinePoll, LinkWait::kRequest);
    const std::int64_t now_ns = me.settings.clock->steadyNs();
    me.fail(connectionLostError("the server did not answer in time"),
            [now_ns](const Waiting& one) { return one.until_ns <= now_ns; });
  }
  me.watching_deadlines = false;
}

void ServerLinkState::take(pb::Envelope envelope) {
  if (abandoned) return;
  if (envelope.has_ping()) {
    channel->send(pongTo(envelope.ping(), settings.clock->steadyNs()));
    return;
  }
  if (envelope.has_reply() && waiting.contains(envelope.reply().id())) {
    const std::uint64_t id = envelope.reply().id();
    answer(id, std::move(*envelope.mutable_reply()));
    return;
  }
  if (envelope.has_refusal()) {
    const Error error = errorOf(envelope.refusal());
    if (envelope.refusal().fatal()) server_reason = error;
    if (waiting.contains(envelope.refused_request())) {
      answer(envelope.refused_request(), error);
      return;
    }
  }
  if (envelope.has_bye())
    server_reason = Error{ErrorCode::kUnavailable, "the server said bye: " + envelope.bye().reason()};
  if (handlers.message) handlers.message(envelope);
  if (envelope.has_bye() && channel)
    channel->finish(CloseReason::kPeerClosed, "the server says goodbye: " + envelope.bye().reason());
}

void ServerLinkState::answer(std::uint64_t id, Result<pb::Reply> reply) {
  auto node = waiting.extract(id);
  if (node.mapped().answer) node.mapped().answer(std::move(reply));
}

void ServerLinkState::sendRequest(std::uint64_t id, const Waiting& one) {
  if (!online()) return;
  pb::Envelope envelope;
  *envelope.mutable_request() = *one.request;
  envelope.mutable_request()->set_id(id);
  channel->send(envelope);
  wipeSecrets(*envelope.mutable_request());
}

}  // namespace needlelab
