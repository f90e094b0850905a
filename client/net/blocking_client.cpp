#include "client/net/blocking_client.h"

#include <deque>
#include <optional>
#include <utility>

#include "common/wire/protocol.h"

namespace needlelab {
namespace {

constexpr std::size_t kInboxMessages = 4096;  // above, the oldest live messages are dropped

Task<> connectInto(ClientConfig config, std::optional<Result<ClientConnection>>* result) {
  auto connected = co_await connectClient(config);
  result->emplace(std::move(connected));
}

}  // namespace

struct BlockingClient::State {
  using Clock = std::chrono::steady_clock;

  asio::io_context io{1};
  std::shared_ptr<Channel> channel;
  pb::Welcome welcome;
  std::deque<pb::Envelope> inbox;
  std::optional<Error> ended;
  std::uint64_t next_request = 1, waiting_for = 0;
  std::optional<pb::Envelope> answer;  // Reply or Refusal to `waiting_for`

  /// Runs the connection until `done()` or the deadline. False: deadline.
  template <typename Done>
  bool runUntil(Clock::time_point deadline, Done done) {
    io.restart();
    io.poll();
    while (!done()) {
      if (Clock::now() >= deadline) return false;
      io.restart();
      if (io.run_one_until(deadline) == 0 && io.stopped())
        return done();  // nothing left that could ever happen
    }
    return true;
  }

  static Task<> readLoop(State* state) {
    for (;;) {
      auto got = co_await state->channel->receive();
      if (!got.ok()) {
        if (!state->ended) state->ended = got.error();
        // tell the peer why, when its bytes were at fault
        state->channel->finish(CloseReason::kProtocol, got.error().message);
        co_return;
      }
      state->take(std::move(*got));
    }
  }

  void take(pb::Envelope envelope) {
    if (envelope.has_ping()) {
      channel->send(pongTo(envelope.ping()));
    } else if (waiting_for != 0 && envelope.has_reply() && envelope.reply().id() == waiting_for) {
      answer = std::move(envelope);
    } else if (waiting_for != 0 && envelope.has_refusal() && envelope.refused_request() == waiting_for) {
      answer = std::move(envelope);
    } else {
      // the reason of a coming end is worth more than "connection closed"
      if (envelope.has_refusal() && envelope.refusal().fatal()) ended = errorOf(envelope.refusal());
      if (envelope.has_bye())
        ended = Error{ErrorCode::kUnavailable, "the server said bye: " + envelope.bye().reason()};
      if (inbox.size() >= kInboxMessages &&
          (inbox.front().has_live_frame() || inbox.front().has_station_status())) {
        inbox.pop_front();
      }
      inbox.push_back(std::move(envelope));
    }
  }

  [[nodiscard]] bool closing() const { return channel->closing(); }
  [[nodiscard]] Error endedError() const {
    return ended ? *ended
                 : Error{ErrorCode::kUnavailable, "the connection is closed: " + channel->closeText()};
  }
};

BlockingClient::BlockingClient(std::unique_ptr<State> state) : state_(std::move(state)) {}
BlockingClient::BlockingClient(BlockingClient&&) noexcept = default;
BlockingClient& BlockingClient::operator=(BlockingClient&&) noexcept = default;

BlockingClient::~BlockingClient() {
  if (state_) finish();
}

Result<BlockingClient> BlockingClient::connect(const ClientConfig& config) {
  auto state = std::make_unique<State>();
  std::optional<Result<ClientConnection>> connected;
  asio::co_spawn(state->io, connectInto(config, &connected), rethrow);
  // connectClient keeps its own time; the rest is for closing a connection that was refused
  while (!connected && state->io.run_one() > 0) {
  }
  if (!connected) return Error{ErrorCode::kFailed, "connecting ended without a result"};
  if (!connected->ok()) {
    state->io.run_for(std::chrono::milliseconds(200));
    return connected->error();
  }
  state->channel = (*connected)->channel;
  state->welcome = (*connected)->welcome;
  asio::co_spawn(state->io, State::readLoop(state.get()), rethrow);
  return BlockingClient(std::move(state));
}

Result<pb::Reply> BlockingClient::call(pb::Request request, std::chrono::milliseconds timeout) {
  State& state = *state_;
  const std::uint64_t id = state.next_request++;
  request.set_id(id);
  pb::Envelope envelope;
  *envelope.mutable_request() = std::move(request);
  state.waiting_for = id;
  state.answer.reset();
  if (!state.channel->send(envelope)) return state.endedError();
  const bool done = state.runUntil(State::Clock::now() + timeout, [&] {
    return state.answer.has_value() || state.closing() || state.ended.has_value();
  });
  state.waiting_for = 0;
  if (state.answer) {
    if (state.answer->has_refusal()) return errorOf(state.answer->refusal());
    return std::move(*state.answer->mutable_reply());
  }
  if (!done) {
    return Error{ErrorCode::kUnavailable,
                 "the server did not answer within " + std::to_string(timeout.count()) + " ms"};
  }
  return state.endedError();
}

Result<pb::Envelope> BlockingClient::receive(std::chrono::milliseconds timeout) {
  State& state = *state_;
  state.runUntil(State::Clock::now() + timeout,
                 [&] { return !state.inbox.empty() || state.closing() || state.ended.has_value(); });
  if (!state.inbox.empty()) {
    pb::Envelope first = std::move(state.inbox.front());
    state.inbox.pop_front();
    return first;
  }
  if (state.closing() || state.ended) return state.endedError();
  return Error{ErrorCode::kNotFound, "no message within " + std::to_string(timeout.count()) + " ms"};
}

Status BlockingClient::send(const pb::Envelope& envelope) {
  if (!state_->channel->send(envelope)) return state_->endedError();
  return {};
}

void BlockingClient::finish(const std::string& reason) {
  State& state = *state_;
  pb::Envelope bye;
  bye.mutable_bye()->set_reason(reason);
  state.channel->finish(CloseReason::kLocal, reason, &bye);
  // the channel closes itself after its close_grace
  state.runUntil(State::Clock::now() + std::chrono::seconds(5), [&] { return state.channel->closed(); });
}

const pb::Welcome& BlockingClient::welcome() const {
  return state_->welcome;
}
bool BlockingClient::connected() const {
  return !state_->channel->closing() && !state_->ended;
}

}  // namespace needlelab
