// Requests of people and stations. The service executes them on worker threads; this completes them.
#include <fmt/core.h>
#include <chrono>
#include <functional>
#include <memory>
#include <utility>

#include "common/base/secret.h"
#include "common/base/time/clock.h"
#include "common/wire/protocol.h"
#include "server/live/limits/server_limits.h"
#include "server/live/port/connection.h"
#include "server/live/port/request_effects.h"

namespace needlelab {

/// `shares`: the request's shares of the budgets. The one for the decoded message ends with the answer.
Task<> PeerConnection::execute(std::shared_ptr<PeerConnection> self, pb::Request request, Shares shares) {
  PeerConnection& peer = *self;
  const std::shared_ptr<const pb::Request> shared = wipedWhenReleased(std::move(request));
  ++peer.requests_at_work_;
  std::function<bool()> gone = [gone = peer.gone_] { return gone->load(); };
  const auto outcome = co_await executeRequest(peer.context_, peer.who_, shared, std::move(gone));
  // the person changed their own access and keeps this connection
  if (outcome->access_number) peer.who_.access_number = outcome->access_number;
  co_await peer.answer(*shared, std::move(*outcome), std::move(*shares.reply));
  --peer.requests_at_work_;
  peer.freed_.notify();
}

/// `room`: for the reply, held until the reply has been read. `request` outlives this call, because execute()
/// waits for it.
Task<> PeerConnection::answer(const pb::Request& request, Outcome outcome, ByteBudget::Share room) {
  const Doer by = who_.doer();
  auto refusal = co_await complete(context_, request, by, outcome);
  if (refusal) {
    if (!gone()) refuse(std::move(*refusal), request.id());
    followUp(context_, outcome, by, this);
    co_return;
  }
  pb::Envelope envelope;
  *envelope.mutable_reply() = std::move(outcome.reply);
  envelope.mutable_reply()->set_id(request.id());
  // a reply that is too long is an error for the requester and must not end the connection
  const std::size_t bytes = envelope.ByteSizeLong();
  if (bytes > kMaxFrameBytes) {
    refuse(pb::Refusal::TOO_LARGE,
           fmt::format("the reply has {} bytes, at most {} can be sent: ask for less at once", bytes,
                       kMaxFrameBytes),
           request.id());
  } else {
    room.become(bytes);
    sendHolding(envelope, std::make_shared<const ByteBudget::Share>(std::move(room)));
    if (envelope.reply().has_new_code()) wipe(*envelope.mutable_reply()->mutable_new_code()->mutable_code());
  }
  outcome.reply = std::move(*envelope.mutable_reply());
  followUp(context_, outcome, by, this);
}

Task<bool> PeerConnection::sendConfirmed(pb::Envelope envelope) {
  return confirmedBy(shared_from_this(), std::move(envelope));
}

Task<bool> PeerConnection::confirmedBy(std::shared_ptr<PeerConnection> self, pb::Envelope envelope) {
  PeerConnection& peer = *self;
  const std::uint64_t id = ++peer.pings_asked_;
  pb::Envelope ping;
  ping.mutable_ping()->set_id(id);
  ping.mutable_ping()->set_sender_steady_ns(steadyNowNs());
  peer.sendControl(envelope);
  peer.sendControl(ping);
  const auto end = std::chrono::steady_clock::now() + peer.context_.limits.bounds.confirm_timeout;
  asio::steady_timer limit(peer.context_.io, end);
  limit.async_wait([self](const boost::system::error_code&) { self->pong_.notify(); });
  while (peer.pings_answered_ < id && !peer.over() && !peer.channel_->closing() &&
         std::chrono::steady_clock::now() < end) {
    co_await peer.pong_.wait();
  }
  co_return peer.pings_answered_ >= id;
}

}  // namespace needlelab
