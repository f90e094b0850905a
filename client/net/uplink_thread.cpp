// The uplink's own thread: connects, keeps time, sends what may be sent.
#include <algorithm>
#include <utility>

#include "client/net/backoff.h"
#include "client/net/uplink.h"
#include "client/net/uplink_call.h"
#include "common/base/clock.h"

namespace needlelab {
namespace {

constexpr std::size_t kMostQueuedBytes = 1u << 20;  // chunks wait in the spool, not in the channel's queue
constexpr auto kStatusEvery = std::chrono::milliseconds(100);
constexpr std::uint64_t kFirstProbes = 8;   // one with each status line, then
constexpr std::uint64_t kProbeEvery = 100;  // … one in 100 status lines

std::uint64_t seedNow() {
  return static_cast<std::uint64_t>(wallNowNs()) ^ static_cast<std::uint64_t>(steadyNowNs()) << 20;
}

}  // namespace

Task<> Uplink::run() {
  Backoff backoff(seedNow(), {config_.first_retry, config_.most_retry, 2.0});
  const std::string server = endpointText(config_.client.server);
  while (!stopping_) {
    auto connection = co_await connectClient(config_.client);
    std::string why;
    bool denied = false;
    if (connection.ok()) {
      const std::int64_t connected_ns = steadyNowNs();
      said_.clear();
      {
        const std::scoped_lock lock(mutex_);
        state_.connected = true;
        state_.away_since_ns = 0;
        state_.denied = false;
        ++state_.connections;
      }
      say("connected to " + server + " as " + connection->welcome.name());
      co_await serve(std::move(*connection));
      why = channel_->closeText();
      // only a connection that lasted is a success: two stations with one key would else throw each other out
      // for ever, five times a second
      if (steadyNowNs() - connected_ns > std::chrono::nanoseconds(config_.most_retry).count())
        backoff.reset();
      // what is queued (our goodbye) still has to go; the channel bounds the time
      for (asio::steady_timer timer(io_); !channel_->closed();) {
        timer.expires_after(std::chrono::milliseconds(10));
        co_await timer.async_wait(kUseTuple);
      }
      channel_.reset();
      watched_.store(false, std::memory_order_relaxed);
      for (const auto& session : sessions_) session->onConnectionLost();
      if (!stopping_)
        say("the connection to " + server + " is lost (" + why +
            "); the spool keeps everything, trying again");
    } else {
      why = connection.error().message;
      denied = connection.error().code == ErrorCode::kDenied ||
               connection.error().code == ErrorCode::kVersion ||
               connection.error().code == ErrorCode::kInvalidInput;
      // said once, not at every try
      if (!stopping_ && why != said_) say(why + (denied ? "" : "; the spool keeps everything, trying again"));
      said_ = why;
    }
    {
      const std::scoped_lock lock(mutex_);
      if (state_.connected) state_.away_since_ns = steadyNowNs();
      state_.connected = false;
      state_.denied = denied;
      state_.error = why;
      live_.clear();
      if (call_) call_->sent_as = 0;
    }
    changed_.notify_all();
    if (stopping_) break;
    // a server that says no is not asked every second
    retry_timer_.expires_after(denied ? config_.most_retry : backoff.next());
    co_await retry_timer_.async_wait(kUseTuple);
  }
  io_.stop();
}

Task<> Uplink::serve(ClientConnection connection) {
  channel_ = connection.channel;
  clock_ = ClockProbe{};
  clock_sent_ns_ = 0;
  probes_ = frame_seq_ = 0;
  welcome_ = std::move(connection.welcome);
  for (const auto& session : sessions_) {
    const bool was_closed = session->closed();
    session->onConnected(there(*session));
    if (was_closed && !session->closed()) sayItIsSentAgain(*session);
  }
  asio::co_spawn(io_, keepTime(), rethrow);
  pump();
  for (;;) {
    auto envelope = co_await channel_->receive();
    if (!envelope.ok()) {
      channel_->finish(CloseReason::kProtocol, envelope.error().message);
      co_return;
    }
    handle(*envelope);
    pump();
  }
}

UplinkSession::There Uplink::there(const UplinkSession& session) const {
  const auto& open = welcome_.open_sessions();
  if (std::any_of(open.begin(), open.end(), [&](const auto& each) {
        return each.session_id() == session.spool()->description().session_id();
      }))
    return UplinkSession::There::kOpen;
  return open.size() < UplinkSession::kFullWelcome ? UplinkSession::There::kNotOpen
                                                   : UplinkSession::There::kUnsaid;
}

void Uplink::sayItIsSentAgain(const UplinkSession& session) const {
  say("session " + session.spool()->idText() +
      ": the server has not all of it any more, an older backup was restored there; it is sent again");
}

// status lines, probes and receipts, as long as this connection lasts
Task<> Uplink::keepTime() {
  const std::shared_ptr<Channel> channel = channel_;
  asio::steady_timer timer(io_);
  for (std::uint64_t round = 0; !channel->closing() && channel_ == channel; ++round) {
    if (round < kFirstProbes || round % kProbeEvery == 0) sendProbe();
    sendStatus();
    pump();
    for (const auto& session : sessions_) session->saveReceipt(steadyNowNs(), false);
    timer.expires_after(kStatusEvery);
    co_await timer.async_wait(kUseTuple);
  }
}
void Uplink::takeAdded() {
  std::vector<std::pair<std::shared_ptr<SpoolSession>, bool>> added;
  {
    const std::scoped_lock lock(mutex_);
    added.swap(added_);
    current_added_ = false;
  }
  for (auto& [spool, current] : added) {
    auto session =
        std::make_unique<UplinkSession>(std::move(spool), config_.client.login.station().station());
    if (channel_) session->onConnected(there(*session));
    if (current) {
      current_ = session.get();
      sessions_.insert(sessions_.begin(), std::move(session));
    } else {
      sessions_.push_back(std::move(session));
    }
  }
}

// sends whatever may be sent now: the current session first, of the others one at a time
void Uplink::pump() {
  takeAdded();
  if (channel_ && !channel_->closing()) {
    {
      const std::scoped_lock lock(mutex_);
      if (call_ && call_->sent_as == 0 && !call_->result) {
        pb::Envelope envelope;
        call_->sent_as = ++request_;
        *envelope.mutable_request() = call_->request;
        envelope.mutable_request()->set_id(request_);
        channel_->send(envelope);
      }
    }
    std::uint64_t in_flight = 0;
    for (const auto& session : sessions_)
      if (!session->finished()) in_flight += session->inFlight();
    for (const auto& session : sessions_) {
      if (session->refused()) continue;
      for (;;) {
        const bool room =
            in_flight < config_.window_chunks && channel_->controlQueueBytes() < kMostQueuedBytes;
        auto message = session->next(room);
        if (!message) break;
        if (message->has_chunk()) ++in_flight;
        if (!channel_->send(*message)) break;
      }
      if (session->refused()) say("session " + session->spool()->idText() + ": " + session->trouble());
      // the next old session begins when this one is through
      if (session.get() != current_ && (!session->finished() || session->asking())) break;
    }
  }
  publish();
}

void Uplink::publish() {
  std::uint64_t left = 0, open = 0;
  for (const auto& session : sessions_) {
    if (session->closed()) continue;
    const std::uint64_t chunks = session->spool()->contents().chunks;
    left += chunks - std::min(chunks, session->committed());
    if (!session->finished()) ++open;
  }
  {
    const std::scoped_lock lock(mutex_);
    state_.chunks_left = left;
    state_.sessions_open = open + added_.size();
    state_.clock = clock_.best();
    if (current_ != nullptr && !current_added_) {
      state_.current_committed = current_->committed();
      if (current_->closed()) state_.current_verdict = current_->verdict();
      state_.current_trouble = current_->trouble();
    }
  }
  changed_.notify_all();
}

}  // namespace needlelab
