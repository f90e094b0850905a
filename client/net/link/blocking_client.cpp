#include "client/net/link/blocking_client.h"

#include <fmt/core.h>

#include <algorithm>
#include <deque>
#include <limits>
#include <optional>
#include <utility>

namespace needlelab {
namespace {

constexpr std::size_t kInboxMessages = 4096;              // above, the oldest live messages are dropped
constexpr std::int64_t kLastMessages_ns = 5'000'000'000;  // for remaining messages of a lost connection
constexpr std::int64_t kStopPoll_ns = 20'000'000;
constexpr std::int64_t kNever_ns = std::numeric_limits<std::int64_t>::max();

}  // namespace

struct BlockingClient::State {
  explicit State(LinkSettings settings)
      : clock(settings.clock), link(io, whole(std::move(settings)), handlers()) {}

  asio::io_context io{1};
  std::shared_ptr<LinkClock> clock;
  std::deque<pb::Envelope> inbox;
  std::optional<LinkEnd> end;  // of the last connection or attempt; nothing while connected
  std::uint64_t ends = 0;      // so far
  ServerLink link;

  static LinkSettings whole(LinkSettings settings) {
    settings.reconnects = false;
    return settings;
  }

  LinkHandlers handlers() {
    return {.accept = {},
            .connected = [this](const pb::Welcome&) { end.reset(), inbox.clear(); },
            .message = [this](pb::Envelope& envelope) { keep(std::move(envelope)); },
            .judge =
                [](const LinkEnd& why) {
                  const bool refused =
                      why.error.code == ErrorCode::kDenied || why.error.code == ErrorCode::kVersion;
                  return refused && !why.was_connected ? Retry::kNever : Retry::kBackOff;
                },
            .away =
                [this](const LinkEnd& why) {
                  end = why;
                  ++ends;
                }};
  }

  void keep(pb::Envelope envelope) {
    if (inbox.size() >= kInboxMessages &&
        (inbox.front().has_live_frame() || inbox.front().has_station_status()))
      inbox.pop_front();
    inbox.push_back(std::move(envelope));
  }

  /// Runs the connection until `done()` or the clock's `due_ns`. False: the time is over.
  template <typename Done>
  bool runUntil(std::int64_t due_ns, Done done) {
    io.restart();
    io.poll();
    while (!done()) {
      if (clock->steadyNs() >= due_ns) return false;
      io.restart();
      clock->runOne(io, due_ns);
      if (io.stopped()) return done();  // no more events are possible
    }
    return true;
  }
  template <typename Done>
  bool runFor(std::chrono::milliseconds time, Done done) {
    return runUntil(clock->steadyNs() + std::chrono::nanoseconds(time).count(), done);
  }
};

BlockingClient::BlockingClient(std::unique_ptr<State> state) : state_(std::move(state)) {}
BlockingClient::BlockingClient(BlockingClient&&) noexcept = default;
BlockingClient& BlockingClient::operator=(BlockingClient&&) noexcept = default;

BlockingClient::~BlockingClient() {
  if (state_) finish();
}

Result<BlockingClient> BlockingClient::connect(const ClientConfig& config, LinkSettings settings) {
  auto state = std::make_unique<State>(std::move(settings));
  state->link.logIn(config);
  // connectClient has its own time-out; the extra time is for closing a refused connection
  state->runUntil(kNever_ns, [&] { return state->link.online() || state->end.has_value(); });
  if (state->end) {
    state->io.run_for(std::chrono::milliseconds(200));
    return state->end->error;
  }
  return BlockingClient(std::move(state));
}

Status BlockingClient::reconnect(std::int64_t until_ns, const std::function<bool()>& stop) {
  State& state = *state_;
  // first read the remaining messages of the lost connection
  state.runUntil(std::min(until_ns, nowNs() + kLastMessages_ns), [&] { return state.end.has_value(); });
  Status last = Error{ErrorCode::kUnavailable, "the connection is lost"};
  std::uint64_t seen = state.ends;
  state.link.reconnect(true);
  while (nowNs() < until_ns && !stop()) {
    // in short steps, so that Ctrl-C takes effect
    state.runUntil(std::min(until_ns, nowNs() + kStopPoll_ns),
                   [&] { return state.link.online() || state.ends != seen; });
    if (state.link.online()) {
      last = {};
      break;
    }
    if (state.ends == seen) continue;
    seen = state.ends;
    last = state.end->error;
    if (state.end->next_try_ns == 0) break;
  }
  state.link.reconnect(false);
  return last;
}

Result<pb::Reply> BlockingClient::call(pb::Request request, std::chrono::milliseconds timeout) {
  State& state = *state_;
  if (!state.link.online()) return state.link.endError();
  std::optional<Result<pb::Reply>> reply;
  const std::uint64_t id = state.link.ask(
      std::move(request), [&reply](Result<pb::Reply> got) { reply.emplace(std::move(got)); }, OnLoss::kResend,
      ServerLink::kForever);
  const bool done = state.runFor(timeout, [&] { return reply.has_value() || !state.link.online(); });
  state.link.forget(id);
  if (reply) return std::move(*reply);
  if (!done)
    return Error{ErrorCode::kUnavailable,
                 fmt::format("the server did not answer within {} ms", timeout.count())};
  return state.link.endError();
}

Result<pb::Envelope> BlockingClient::receive(std::chrono::milliseconds timeout) {
  State& state = *state_;
  state.runFor(timeout, [&] { return !state.inbox.empty() || !state.link.online(); });
  if (!state.inbox.empty()) {
    pb::Envelope first = std::move(state.inbox.front());
    state.inbox.pop_front();
    return first;
  }
  if (!state.link.online()) return state.link.endError();
  return Error{ErrorCode::kNotFound, fmt::format("no message within {} ms", timeout.count())};
}

Status BlockingClient::send(const pb::Envelope& envelope) {
  if (!state_->link.send(envelope)) return state_->link.endError();
  return {};
}

void BlockingClient::finish(const std::string& reason) {
  State& state = *state_;
  bool done = false;
  state.link.stop(reason, [&done] { done = true; });
  // the channel closes itself after its close_grace
  state.runFor(std::chrono::seconds(5), [&done] { return done; });
}

const pb::Welcome& BlockingClient::welcome() const {
  return state_->link.welcome();
}
const Endpoint& BlockingClient::server() const {
  return state_->link.server();
}
bool BlockingClient::connected() const {
  return state_->link.online();
}
std::int64_t BlockingClient::nowNs() const {
  return state_->clock->steadyNs();
}

}  // namespace needlelab
