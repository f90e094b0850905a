// Requests of people and stations: executed by the service on worker threads, completed here.
#include <utility>

#include "common/base/clock.h"
#include "common/wire/protocol.h"
#include "server/live/connection.h"
#include "server/live/request_effects.h"

namespace needlelab {

Task<> PeerConnection::execute(std::shared_ptr<PeerConnection> self, pb::Request request) {
  PeerConnection& peer = *self;
  const std::shared_ptr<const pb::Request> shared = heldSecretly(std::move(request));
  ++peer.requests_at_work_;
  Service& service = peer.context_.store.service();
  std::function<Outcome()> work = [&service, shared, who = peer.who_] {
    if (shared->has_run_retention() || shared->has_rescore_all()) afterOthers();
    return service.execute(who, *shared);
  };
  Outcome outcome = co_await offload(poolFor(peer.context_, *shared), std::move(work));
  co_await peer.answer(*shared, std::move(outcome));
  --peer.requests_at_work_;
  peer.freed_.notify();
}

// `request` outlives it: execute waits for it
Task<> PeerConnection::answer(const pb::Request& request, Outcome outcome) {
  auto refusal = co_await complete(context_, request, who_.name, outcome);
  if (refusal) {
    refuse(std::move(*refusal), request.id());
    co_return;
  }
  pb::Envelope envelope;
  *envelope.mutable_reply() = std::move(outcome.reply);
  envelope.mutable_reply()->set_id(request.id());
  // a reply that does not fit is the asker's to narrow down, not a reason to lose the connection
  if (envelope.ByteSizeLong() > kMaxFrameBytes) {
    refuse(pb::Refusal::TOO_LARGE,
           "the reply has " + std::to_string(envelope.ByteSizeLong()) + " bytes, at most " +
               std::to_string(kMaxFrameBytes) + " can be sent: ask for less at once",
           request.id());
  } else {
    sendControl(envelope);
  }
  followUp(context_, request, envelope.reply(), who_.name, this);
}

Task<bool> PeerConnection::sendConfirmed(std::shared_ptr<PeerConnection> self, pb::Envelope envelope) {
  PeerConnection& peer = *self;
  const std::uint64_t id = ++peer.pings_asked_;
  pb::Envelope ping;
  ping.mutable_ping()->set_id(id);
  ping.mutable_ping()->set_sender_steady_ns(steadyNowNs());
  peer.sendControl(envelope);
  peer.sendControl(ping);
  const auto end = std::chrono::steady_clock::now() + peer.context_.bounds.confirm_timeout;
  asio::steady_timer limit(peer.context_.io, end);
  limit.async_wait([self](const boost::system::error_code&) { self->pong_.notify(); });
  while (peer.pings_answered_ < id && !peer.over() && !peer.channel_->closing() &&
         std::chrono::steady_clock::now() < end) {
    co_await peer.pong_.wait();
  }
  co_return peer.pings_answered_ >= id;
}

}  // namespace needlelab
