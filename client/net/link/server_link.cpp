#include "client/net/link/server_link.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "client/net/link/server_choice.h"
#include "common/base/time/clock.h"
#include "common/wire/protocol.h"
#include "proto/session_rules.h"

namespace needlelab {
namespace {

constexpr std::chrono::milliseconds kLookAtDeadlines{250};

std::uint64_t seedNow() {
  return static_cast<std::uint64_t>(wallNowNs()) ^ static_cast<std::uint64_t>(steadyNowNs()) << 20;
}

std::int64_t nanoseconds(std::chrono::milliseconds time) {
  return std::chrono::nanoseconds(time).count();
}

/// Whether all servers of a lab would give this refusal. RATE_LIMITED tells people that they guessed too
/// often or have too many connections, and a station that the server has no place.
bool isSaidByAll(pb::Refusal::Reason reason, bool to_person) {
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

Error lostBeforeAnswer(const std::string& why) {
  return {ErrorCode::kUnavailable,
          why + ": the answer did not come; look whether it happened before you do it again"};
}

}  // namespace

double Backoff::grown() const {
  return static_cast<double>(settings_.first.count()) * std::pow(settings_.factor, std::min(tries_, 1000u));
}

std::chrono::milliseconds Backoff::jittered(double wait_ms) {
  // makes a number in [0, 1) from 53 random bits: std's distributions differ between libraries
  const double u = static_cast<double>(random_() >> 11) * 0x1p-53;
  return std::chrono::milliseconds(static_cast<std::int64_t>(wait_ms * (0.5 + 0.5 * u)));
}

std::chrono::milliseconds Backoff::next(std::chrono::milliseconds most) {
  const double wait_ms = std::min(static_cast<double>(std::min(most, settings_.most).count()), grown());
  ++tries_;
  return jittered(wait_ms);
}

std::chrono::milliseconds Backoff::nextProbe() {
  const auto longest = static_cast<double>(std::min(settings_.probe, settings_.most).count());
  if (grown() >= longest) return jittered(longest);
  return next();
}

/// The coroutines share the state, so that it lives until they have ended, even after the link.
struct ServerLink::State {
  struct WipeAndDelete {
    void operator()(pb::Request* request) const {
      wipeSecrets(*request);
      delete request;
    }
  };
  struct Waiting {
    std::unique_ptr<pb::Request, WipeAndDelete> request;  // may contain a code or a password
    Answer answer;
    OnLoss on_loss = OnLoss::kAskAgain;
    std::int64_t until_ns = 0;
  };

  State(asio::io_context& context, LinkSettings chosen, LinkHandlers given)
      : io(context),
        settings(std::move(chosen)),
        handlers(std::move(given)),
        seed(settings.seed != 0 ? settings.seed : seedNow()),
        backoff(seed, settings.retry),
        reconnects(settings.reconnects) {}

  static Task<> run(std::shared_ptr<State> self);
  static Task<> watchDeadlines(std::shared_ptr<State> self);
  Task<Result<ClientConnection>> connectToAny(LinkEnd& end, std::uint64_t number);
  Task<Result<ClientConnection>> connect(ClientConfig chosen, std::uint64_t number, ConnectTry& attempt);
  Task<> serve(ClientConnection connection);
  Task<> waitForNextTry(LinkEnd& end, std::uint64_t number);
  void take(pb::Envelope envelope);
  void answer(std::uint64_t id, Result<pb::Reply> reply);
  void sendRequest(std::uint64_t id, const Waiting& one);
  template <typename Which>
  void fail(const Error& error, Which which);
  [[nodiscard]] bool online() const { return channel && !channel->closing() && !server_said; }

  asio::io_context& io;
  LinkSettings settings;
  LinkHandlers handlers;
  const std::uint64_t seed;
  Backoff backoff;
  bool reconnects;
  bool probing = false;        // the next attempt follows a Retry::kProbe
  asio::steady_timer nap{io};  // run() waits on it; cancelled on each change
  std::optional<ClientConfig> config;
  std::shared_ptr<ServerChoice> choice;  // for `config`
  Endpoint server;                       // of the last connection
  std::string passed_over;
  std::uint64_t login_number = 0;  // counts log-ins and log-outs
  std::string token;
  std::int64_t token_until_unix_ns = 0;

  std::shared_ptr<Channel> channel;  // while connected
  pb::Welcome welcome;
  std::uint64_t connections = 0;
  std::optional<Error> server_said;  // the server's reason for ending the connection
  std::optional<Error> ended;        // the last connection's end
  std::chrono::milliseconds read_pause{0};

  std::map<std::uint64_t, Waiting> waiting;
  std::uint64_t next_request = 1;
  bool watching_deadlines = false;

  bool stopping = false, abandoned = false, running = true;
  std::function<void()> stopped;
};

Task<> ServerLink::State::run(std::shared_ptr<State> self) {
  State& me = *self;
  while (!me.stopping) {
    if (!me.config) {
      co_await me.settings.clock->wait(me.nap, kForever, LinkWait::kRetry);
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
      end.said_by_server = me.server_said.has_value();
      end.error = me.server_said.value_or(*me.ended);
      end.channel_text = me.channel->closeText();
      me.ended = end.error;
      me.channel.reset();
      me.server_said.reset();
      me.fail(lostBeforeAnswer(end.said_by_server ? end.error.message
                                                  : "the connection is lost: " + end.channel_text),
              [](const Waiting& one) { return one.on_loss == OnLoss::kGiveUp; });
      const std::int64_t lasted_ns = me.settings.clock->steadyNs() - connected_ns;
      const bool is_short = end.others && !end.said_by_server;
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
Task<Result<ClientConnection>> ServerLink::State::connectToAny(LinkEnd& end, std::uint64_t number) {
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
    if (isSaidByAll(attempt.refused, config->login.has_person())) {
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
Task<Result<ClientConnection>> ServerLink::State::connect(ClientConfig chosen, std::uint64_t number,
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

Task<> ServerLink::State::serve(ClientConnection connection) {
  channel = std::move(connection.channel);
  welcome = std::move(connection.welcome);
  server_said.reset();
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

Task<> ServerLink::State::waitForNextTry(LinkEnd& end, std::uint64_t number) {
  end.stopping = stopping;
  if (end.error.code == ErrorCode::kDenied) token.clear();
  const Retry retry = handlers.judge && !abandoned ? handlers.judge(end) : Retry::kBackOff;
  std::chrono::milliseconds time = kForever;
  if (retry == Retry::kSlowly) time = settings.retry.most;
  if (retry == Retry::kBackOff && reconnects)
    time = choice && choice->several() ? backoff.next(settings.most_of_several) : backoff.next();
  probing = retry == Retry::kProbe;
  if (probing && reconnects) time = backoff.nextProbe();
  if (!reconnects) time = kForever;
  if (time != kForever && !stopping) end.next_try_ns = settings.clock->steadyNs() + nanoseconds(time);
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
Task<> ServerLink::State::watchDeadlines(std::shared_ptr<State> self) {
  State& me = *self;
  asio::steady_timer timer(me.io);
  while (!me.waiting.empty() && !me.stopping) {
    co_await me.settings.clock->wait(timer, kLookAtDeadlines, LinkWait::kRequest);
    const std::int64_t now_ns = me.settings.clock->steadyNs();
    me.fail(lostBeforeAnswer("the server did not answer in time"),
            [now_ns](const Waiting& one) { return one.until_ns <= now_ns; });
  }
  me.watching_deadlines = false;
}

void ServerLink::State::take(pb::Envelope envelope) {
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
    if (envelope.refusal().fatal()) server_said = error;
    if (waiting.contains(envelope.refused_request())) {
      answer(envelope.refused_request(), error);
      return;
    }
  }
  if (envelope.has_bye())
    server_said = Error{ErrorCode::kUnavailable, "the server said bye: " + envelope.bye().reason()};
  if (handlers.message) handlers.message(envelope);
  if (envelope.has_bye() && channel)
    channel->finish(CloseReason::kPeerClosed, "the server says goodbye: " + envelope.bye().reason());
}

void ServerLink::State::answer(std::uint64_t id, Result<pb::Reply> reply) {
  auto node = waiting.extract(id);
  if (node.mapped().answer) node.mapped().answer(std::move(reply));
}

template <typename Which>
void ServerLink::State::fail(const Error& error, Which which) {
  std::vector<Answer> failed;
  for (auto it = waiting.begin(); it != waiting.end();) {
    if (!which(it->second)) {
      ++it;
      continue;
    }
    failed.push_back(std::move(it->second.answer));
    it = waiting.erase(it);
  }
  // after the loop, because an answer may call `ask`
  for (const Answer& each : failed)
    if (each && !abandoned) each(error);
}

void ServerLink::State::sendRequest(std::uint64_t id, const Waiting& one) {
  if (!online()) return;
  pb::Envelope envelope;
  *envelope.mutable_request() = *one.request;
  envelope.mutable_request()->set_id(id);
  channel->send(envelope);
  wipeSecrets(*envelope.mutable_request());
}

ServerLink::ServerLink(asio::io_context& io, LinkSettings settings, LinkHandlers handlers)
    : state_(std::make_shared<State>(io, std::move(settings), std::move(handlers))) {
  asio::co_spawn(io, State::run(state_), rethrow);
}

ServerLink::~ServerLink() {
  State& state = *state_;
  state.abandoned = state.stopping = true;
  state.waiting.clear();
  state.nap.cancel();
  if (state.channel) state.channel->close(CloseReason::kLocal, "the link ends");
}

void ServerLink::logIn(ClientConfig config) {
  State& state = *state_;
  state.choice = std::make_shared<ServerChoice>(config.servers(), ~state.seed, state.settings.clock->time());
  state.server = config.server;
  state.passed_over.clear();
  state.config = std::move(config);
  ++state.login_number;
  state.token.clear();
  state.backoff.reset();
  if (state.channel) state.channel->finish(CloseReason::kLocal, "another log-in");
  state.nap.cancel();
}

void ServerLink::logOut(const std::string& reason) {
  State& state = *state_;
  state.config.reset();
  ++state.login_number;
  state.token.clear();
  state.fail({ErrorCode::kUnavailable, reason}, [](const State::Waiting&) { return true; });
  pb::Envelope bye;
  bye.mutable_bye()->set_reason(reason);
  if (state.channel) state.channel->finish(CloseReason::kLocal, reason, &bye);
  state.nap.cancel();
}

void ServerLink::retryNow() {
  state_->nap.cancel();
}

void ServerLink::reconnect(bool wanted) {
  if (wanted == state_->reconnects) return;
  state_->reconnects = wanted;
  if (wanted) state_->nap.cancel();
}

void ServerLink::stop(const std::string& reason, std::function<void()> done) {
  State& state = *state_;
  state.stopping = true;
  state.fail({ErrorCode::kFailed, "the program ends"}, [](const State::Waiting&) { return true; });
  state.nap.cancel();
  // an attempt to connect needs no Bye: it ends by itself
  if (!state.running || !state.channel) {
    if (done) done();
    return;
  }
  state.stopped = std::move(done);
  pb::Envelope bye;
  bye.mutable_bye()->set_reason(reason);
  state.channel->finish(CloseReason::kLocal, reason, &bye);
}

std::uint64_t ServerLink::ask(pb::Request request, Answer answer, OnLoss on_loss,
                              std::chrono::milliseconds patience) {
  State& state = *state_;
  const std::uint64_t id = state.next_request++;
  const auto refuse = [&](ErrorCode code, const char* why) { answer(Error{code, why}); };
  if (state.stopping)
    refuse(ErrorCode::kFailed, "the program ends");
  else if (on_loss == OnLoss::kGiveUp && !state.online())
    refuse(ErrorCode::kUnavailable, "there is no connection to the server now: nothing was done");
  else if (state.waiting.size() >= state.settings.most_waiting)
    refuse(ErrorCode::kUnavailable, "too many requests wait for an answer");
  else {
    const std::int64_t until_ns = patience >= kForever
                                      ? std::numeric_limits<std::int64_t>::max()
                                      : state.settings.clock->steadyNs() + nanoseconds(patience);
    std::unique_ptr<pb::Request, State::WipeAndDelete> kept(new pb::Request(std::move(request)));
    const auto placed =
        state.waiting.emplace(id, State::Waiting{std::move(kept), std::move(answer), on_loss, until_ns});
    state.sendRequest(id, placed.first->second);
    if (patience < kForever && !std::exchange(state.watching_deadlines, true))
      asio::co_spawn(state.io, State::watchDeadlines(state_), rethrow);
  }
  return id;
}

void ServerLink::forget(std::uint64_t id) {
  state_->waiting.erase(id);
}

bool ServerLink::send(const pb::Envelope& envelope) {
  return state_->channel && state_->channel->send(envelope);
}

void ServerLink::sendLive(Frame frame, bool counted) {
  if (state_->channel) state_->channel->sendLive(std::move(frame), counted);
}

void ServerLink::drop(CloseReason reason, const std::string& text) {
  if (state_->channel) state_->channel->finish(reason, text);
}

void ServerLink::cut(const std::string& text) {
  if (state_->channel) state_->channel->close(CloseReason::kLocal, text);
}

bool ServerLink::moveOn(const std::string& why) {
  State& state = *state_;
  if (!state.online() || !state.choice->hasBetter()) return false;
  pb::Envelope bye;
  bye.mutable_bye()->set_reason(why);
  state.channel->finish(CloseReason::kLocal, why, &bye);
  return true;
}

void ServerLink::pauseReading(std::chrono::milliseconds time) {
  state_->read_pause = time;
}

bool ServerLink::online() const {
  return state_->online();
}

const pb::Welcome& ServerLink::welcome() const {
  return state_->welcome;
}

const Endpoint& ServerLink::server() const {
  return state_->server;
}

const std::string& ServerLink::passedOver() const {
  return state_->passed_over;
}

std::uint64_t ServerLink::connections() const {
  return state_->connections;
}

std::size_t ServerLink::waiting() const {
  return state_->waiting.size();
}

std::size_t ServerLink::queuedBytes() const {
  return state_->channel ? state_->channel->controlQueueBytes() : 0;
}

Error ServerLink::endError() const {
  const State& state = *state_;
  if (state.server_said) return *state.server_said;
  if (state.ended) return *state.ended;
  return {ErrorCode::kUnavailable,
          "the connection is closed: " + (state.channel ? state.channel->closeText() : std::string())};
}

}  // namespace needlelab
