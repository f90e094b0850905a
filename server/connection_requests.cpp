// Requests of people and stations: executed by the service on worker threads, completed here.
#include <utility>

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
    default:
      return context.workers;
  }
}

}  // namespace

Task<> PeerConnection::execute(std::shared_ptr<PeerConnection> self, pb::Request request) {
  PeerConnection& peer = *self;
  ++peer.requests_at_work_;
  Service& service = peer.context_.store.service();
  std::function<Outcome()> work = [&service, request, who = peer.who_] {
    return service.execute(who, request);
  };
  Outcome outcome = co_await offload(poolFor(peer.context_, request), std::move(work));
  --peer.requests_at_work_;
  peer.freed_.notify();
  peer.answer(request, std::move(outcome));
}

void PeerConnection::answer(const pb::Request& request, Outcome outcome) {
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
      refusal = deliver(request.trainee_message().station(), message);
      break;
    case Outcome::ServerPart::kNextExercise:
      *message.mutable_next_exercise() = request.next_exercise();
      message.mutable_next_exercise()->set_from(who_.name);
      refusal = deliver(request.next_exercise().station(), message);
      break;
  }
  if (refusal) {
    refuse(std::move(*refusal), request.id());
    return;
  }
  if (reply.result_case() == pb::Reply::RESULT_NOT_SET) reply.mutable_done();
  afterwards(request, reply);

  pb::Envelope envelope;
  *envelope.mutable_reply() = std::move(reply);
  // a reply that does not fit is the asker's to narrow down, not a reason to lose the connection
  if (envelope.ByteSizeLong() > kMaxFrameBytes) {
    refuse(pb::Refusal::TOO_LARGE,
           "the reply has " + std::to_string(envelope.ByteSizeLong()) + " bytes, at most " +
               std::to_string(kMaxFrameBytes) + " can be sent: ask for less at once",
           request.id());
    return;
  }
  sendControl(envelope);
}

std::optional<pb::Refusal> PeerConnection::deliver(const std::string& station, const pb::Envelope& envelope) {
  if (context_.hub.sendToStation(station, envelope)) return std::nullopt;
  return makeRefusal(pb::Refusal::NOT_FOUND, "station '" + station + "' is not online");
}

void PeerConnection::afterwards(const pb::Request& request, const pb::Reply& reply) {
  // a copy: closing a connection takes it out of the map
  const auto others = context_.connections;
  const auto drop = [&](const std::string& name, bool station, const std::string& text) {
    for (const auto& [id, peer] : others) {
      if (peer != this && peer->who().name == name && (peer->who().role == pb::STATION) == station) {
        peer->refuseAndClose(makeRefusal(pb::Refusal::LOGIN, text));
      }
    }
  };
  if (reply.has_backup_done()) {
    ++context_.counters.backups;
    for (const auto& [id, peer] : others) {
      if (peer->who().role == pb::STATION)
        asio::co_spawn(context_.io, tellSafe(peer->shared_from_this()), rethrow);
    }
  }
  if (request.has_revoke_station())
    drop(request.revoke_station().name(), true, "the station's key was revoked");
  if (request.has_disable_user() && !request.disable_user().enable()) {
    context_.tokens.forget(request.disable_user().name());
    drop(request.disable_user().name(), false, "the account was disabled");
  }
  if (request.has_set_password()) context_.tokens.forget(request.set_password().name());
}

}  // namespace needlelab
