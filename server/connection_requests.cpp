// Requests of people and stations: executed by the service on worker threads, completed here.
#include <utility>

#include "base/clock.h"
#include "base/secret.h"
#include "server/connection.h"
#include "server/log.h"
#include "wire/refusal.h"

namespace needlelab {
namespace {

/// Where a request runs, so that a backup of minutes or a flood of passwords does not hold up a lesson.
asio::thread_pool& poolFor(ServerContext& context, const pb::Request& request) {
  switch (request.call_case()) {
    case pb::Request::kAddUser:
    case pb::Request::kSetPassword:
      return context.passwords;
    case pb::Request::kBackup:
    case pb::Request::kCheck:
    case pb::Request::kVerifySession:
      return context.slow_workers;
    case pb::Request::kRunRetention:
      return context.retention_workers;
    default:
      return context.workers;
  }
}

/// A request; the password in it, if any, is wiped at the end, whoever holds it last.
std::shared_ptr<const pb::Request> secretOf(pb::Request request) {
  return {new pb::Request(std::move(request)), [](pb::Request* held) {
            if (held->has_add_user()) wipe(*held->mutable_add_user()->mutable_password());
            if (held->has_set_password()) wipe(*held->mutable_set_password()->mutable_password());
            delete held;
          }};
}

}  // namespace

Task<> PeerConnection::execute(std::shared_ptr<PeerConnection> self, pb::Request request) {
  PeerConnection& peer = *self;
  const std::shared_ptr<const pb::Request> shared = secretOf(std::move(request));
  ++peer.requests_at_work_;
  Service& service = peer.context_.store.service();
  std::function<Outcome()> work = [&service, shared, who = peer.who_] {
    if (shared->has_run_retention()) afterOthers();
    return service.execute(who, *shared);
  };
  Outcome outcome = co_await offload(poolFor(peer.context_, *shared), std::move(work));
  co_await peer.answer(*shared, std::move(outcome));
  --peer.requests_at_work_;
  peer.freed_.notify();
}

// `request` outlives it: execute waits for it
Task<> PeerConnection::answer(const pb::Request& request, Outcome outcome) {
  std::optional<pb::Refusal> refusal;
  if (outcome.error) refusal = refusalOf(*outcome.error);
  pb::Reply& reply = outcome.reply;
  reply.set_id(request.id());

  // what only a running server can add
  pb::Envelope message;
  switch (refusal ? Outcome::ServerPart::kNone : outcome.server_part) {
    case Outcome::ServerPart::kNone:
      break;
    case Outcome::ServerPart::kFillStations:
      context_.hub.fillStations(*reply.mutable_stations());
      break;
    case Outcome::ServerPart::kDeliverMessage:
      *message.mutable_trainee_message() = request.trainee_message();
      message.mutable_trainee_message()->set_from(who_.name);
      refusal = co_await deliver(request.trainee_message().station(), message);
      break;
    case Outcome::ServerPart::kNextExercise:
      *message.mutable_next_exercise() = request.next_exercise();
      message.mutable_next_exercise()->set_from(who_.name);
      refusal = co_await deliver(request.next_exercise().station(), message);
      break;
  }
  if (refusal) {
    refuse(std::move(*refusal), request.id());
    co_return;
  }
  if (reply.result_case() == pb::Reply::RESULT_NOT_SET) reply.mutable_done();
  const bool backup_done = reply.has_backup_done();

  pb::Envelope envelope;
  *envelope.mutable_reply() = std::move(reply);
  // a reply that does not fit is the asker's to narrow down, not a reason to lose the connection
  if (envelope.ByteSizeLong() > kMaxFrameBytes) {
    refuse(pb::Refusal::TOO_LARGE,
           "the reply has " + std::to_string(envelope.ByteSizeLong()) + " bytes, at most " +
               std::to_string(kMaxFrameBytes) + " can be sent: ask for less at once",
           request.id());
  } else {
    sendControl(envelope);
  }
  afterwards(request, backup_done);
}

Task<std::optional<pb::Refusal>> PeerConnection::deliver(std::string station, pb::Envelope envelope) {
  auto* const peer = dynamic_cast<PeerConnection*>(context_.hub.stationPeer(station));
  if (peer == nullptr)
    co_return makeRefusal(pb::Refusal::NOT_FOUND, "station '" + station + "' is not online");
  if (co_await sendConfirmed(peer->shared_from_this(), std::move(envelope))) co_return std::nullopt;
  co_return makeRefusal(pb::Refusal::TIMEOUT,
                        "station '" + station + "' did not confirm it within " +
                            std::to_string(context_.bounds.confirm_timeout.count()) +
                            " ms, or its connection ended: it may not have arrived; say it again when the "
                            "station is back");
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

void PeerConnection::afterwards(const pb::Request& request, bool backup_done) {
  if (backup_done) {
    ++context_.counters.backups;
    for (const auto& [id, peer] : context_.connections) {
      if (peer->who().role == pb::STATION)
        asio::co_spawn(context_.io, tellSafe(peer->shared_from_this()), rethrow);
    }
  }
  if (request.has_revoke_station())
    endAccess(request.revoke_station().name(), true, true, "the station's key was revoked");
  if (request.has_disable_user() && !request.disable_user().enable())
    endAccess(request.disable_user().name(), false, true, "the account was disabled");
  // who sets its own password goes on; its other connections may be those of somebody who knew the old one
  if (request.has_set_password())
    endAccess(request.set_password().name(), false, false, "the password was changed: log in again");
}

void PeerConnection::endAccess(const std::string& name, bool station, bool mine_too,
                               const std::string& text) {
  // log-ins that are being checked now are checked again
  ++context_.access_changes;
  const std::size_t tokens = station ? 0 : context_.tokens.forget(name);
  std::size_t ended = 0;
  // a copy: closing a connection takes it out of the map
  const auto all = context_.connections;
  for (const auto& [id, peer] : all) {
    if (peer->who().name != name || (peer->who().role == pb::STATION) != station || peer->over()) continue;
    if (peer == this && !mine_too) continue;
    peer->refuseAndClose(makeRefusal(pb::Refusal::LOGIN, text));
    ++ended;
  }
  logEvent(LogLevel::kInfo, "access_ended",
           {{"name", name}, {"by", who_.name}, {"connections", ended}, {"tokens", tokens}, {"text", text}});
  if (ended + tokens == 0) return;
  const std::string detail =
      text + "; ended: " + std::to_string(ended) + " connections, " + std::to_string(tokens) + " tokens";
  asio::post(context_.workers, [&service = context_.store.service(), who = who_.name, name, detail] {
    const Status noted = service.note(who, "access ended", name, detail);
    if (!noted.ok()) logEvent(LogLevel::kError, "audit_failed", {{"text", noted.error().message}});
  });
}

}  // namespace needlelab
