#include "client/net/server_link.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "common/base/clock.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

constexpr std::chrono::milliseconds kLookAtDeadlines{250};

std::uint64_t seedNow() {
  return static_cast<std::uint64_t>(wallNowNs()) ^ static_cast<std::uint64_t>(steadyNowNs()) << 20;
}

std::int64_t nanoseconds(std::chrono::milliseconds time) {
  return std::chrono::nanoseconds(time).count();
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

std::chrono::milliseconds Backoff::next() {
  const double wait_ms = std::min(static_cast<double>(settings_.most.count()), grown());
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
    std::unique_ptr<pb::Request, WipeAndDelete> request;  // may hold a code or a password
    Answer answer;
    OnLoss on_loss = OnLoss::kAskAgain;
    std::int64_t until_ns = 0;
  };

  State(asio::io_context& context, LinkSettings chosen, LinkHandlers given)
      : io(context),
        settings(std::move(chosen)),
        handlers(std::move(given)),
        backoff(settings.seed != 0 ? settings.seed : seedNow(), settings.retry),
        reconnects(settings.reconnects) {}

  static Task<> run(std::shared_ptr<State> self);
  static Task<> watchDeadlines(std::shared_ptr<State> self);
  Task<Result<ClientConnection>> connect(ClientConfig chosen, bool by_token, bool& reached);
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
  Backoff backoff;
  bool reconnects;
  bool probing = false;        // the next attempt follows a Retry::kProbe
  asio::steady_timer nap{io};  // run() waits on it; cancelled on each change
  std::optional<ClientConfig> config;
  std::uint64_t login_number = 0;  // counts log-ins and log-outs
  std::string token;
  std::int64_t token_until_unix_ns = 0;

  std::shared_ptr<Channel> channel;  // while connected
  pb::Welcome welcome;
  std::uint64_t connections = 0;
  std::optional<Error> server_said;  // its reason for the coming end
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
    const bool by_token = !me.token.empty() && me.token_until_unix_ns > me.settings.clock->unixNs();
    LinkEnd end;
    auto connection = co_await me.connect(*me.config, by_token, end.reached);
    if (me.stopping || number != me.login_number) {
      if (connection.ok()) connection->channel->finish(CloseReason::kLocal, "another log-in");
      continue;
    }
    if (!connection.ok()) {
      if (by_token && connection.error().code == ErrorCode::kDenied) {
        // the server has restarted and does not know its old tokens: use the password at once
        me.token.clear();
        continue;
      }
      end.error = connection.error();
    } else {
      const std::int64_t connected_ns = me.settings.clock->steadyNs();
      co_await me.serve(std::move(*connection));
      // the queued messages (our Bye) must still go out; the channel bounds the time
      co_await me.channel->untilClosed();
      end.was_connected = true;
      end.said_by_server = me.server_said.has_value();
      end.error = me.server_said.value_or(*me.ended);
      end.channel_text = me.channel->closeText();
      me.ended = end.error;
      me.channel.reset();
      me.server_said.reset();
      me.fail(lostBeforeAnswer(end.said_by_server ? end.error.message
                                                  : "the connection is lost: " + end.channel_text),
              [](const Waiting& one) { return one.on_loss == OnLoss::kGiveUp; });
      if (me.settings.clock->steadyNs() - connected_ns > nanoseconds(me.settings.lasting)) me.backoff.reset();
      if (number != me.login_number && !me.stopping) continue;
    }
    co_await me.waitForNextTry(end, number);
  }
  me.running = false;
  if (me.stopped && !me.abandoned) me.stopped();
}

Task<Result<ClientConnection>> ServerLink::State::connect(ClientConfig chosen, bool by_token, bool& reached) {
  if (by_token) chosen.login.set_token(token);
  // a probe's SYN that got no answer says enough: the next probe follows
  if (probing) chosen.reach_timeout = std::min(chosen.reach_timeout, settings.retry.probe);
  auto connection = co_await connectClient(std::move(chosen), settings.clock, &reached);
  if (connection.ok() && handlers.accept && !abandoned) {
    if (const Status accepted = handlers.accept(connection->welcome); !accepted.ok()) {
      connection->channel->finish(CloseReason::kLocal, accepted.error().message);
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
  if (retry == Retry::kBackOff && reconnects) time = backoff.next();
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

void ServerLink::pauseReading(std::chrono::milliseconds time) {
  state_->read_pause = time;
}

bool ServerLink::online() const {
  return state_->online();
}

const pb::Welcome& ServerLink::welcome() const {
  return state_->welcome;
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
