#include "client/net/link/server_link.h"

#include <memory>
#include <utility>

#include "client/net/link/link_state.h"

namespace needlelab {

ServerLink::ServerLink(asio::io_context& io, LinkSettings settings, LinkHandlers handlers)
    : state_(std::make_shared<ServerLinkState>(io, std::move(settings), std::move(handlers))) {
  asio::co_spawn(io, ServerLinkState::run(state_), rethrow);
}

ServerLink::~ServerLink() {
  ServerLinkState& state = *state_;
  state.abandoned = state.stopping = true;
  state.waiting.clear();
  state.nap.cancel();
  if (state.channel) state.channel->close(CloseReason::kLocal, "the link ends");
}

void ServerLink::logIn(ClientConfig config) {
  ServerLinkState& state = *state_;
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
  ServerLinkState& state = *state_;
  state.config.reset();
  ++state.login_number;
  state.token.clear();
  state.fail({ErrorCode::kUnavailable, reason}, [](const ServerLinkState::Waiting&) { return true; });
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
  ServerLinkState& state = *state_;
  state.stopping = true;
  state.fail({ErrorCode::kFailed, "the program ends"}, [](const ServerLinkState::Waiting&) { return true; });
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
  ServerLinkState& state = *state_;
  const std::uint64_t id = state.next_request++;
  const auto refuse = [&](ErrorCode code, const char* why) { answer(Error{code, why}); };
  if (state.stopping)
    refuse(ErrorCode::kFailed, "the program ends");
  else if (on_loss == OnLoss::kGiveUp && !state.online())
    refuse(ErrorCode::kUnavailable, "there is no connection to the server now: nothing was done");
  else if (state.waiting.size() >= state.settings.max_waiting)
    refuse(ErrorCode::kUnavailable, "too many requests wait for an answer");
  else {
    const std::int64_t until_ns =
        patience >= kForever ? std::numeric_limits<std::int64_t>::max()
                             : state.settings.clock->steadyNs() + ServerLinkState::nanoseconds(patience);
    std::unique_ptr<pb::Request, ServerLinkState::WipeAndDelete> kept(new pb::Request(std::move(request)));
    const auto placed = state.waiting.emplace(
        id, ServerLinkState::Waiting{std::move(kept), std::move(answer), on_loss, until_ns});
    state.sendRequest(id, placed.first->second);
    if (patience < kForever && !std::exchange(state.watching_deadlines, true))
      asio::co_spawn(state.io, ServerLinkState::watchDeadlines(state_), rethrow);
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
  ServerLinkState& state = *state_;
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
  const ServerLinkState& state = *state_;
  if (state.server_reason) return *state.server_reason;
  if (state.ended) return *state.ended;
  return {ErrorCode::kUnavailable,
          "the connection is closed: " + (state.channel ? state.channel->closeText() : std::string())};
}

}  // namespace needlelab
