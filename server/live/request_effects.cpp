#include "server/live/request_effects.h"

#include <boost/asio/post.hpp>
#include <utility>

#include "common/base/secret.h"
#include "common/base/text.h"
#include "common/wire/protocol.h"
#include "db/service/roles.h"
#include "server/live/connection.h"
#include "server/live/log.h"

namespace needlelab {
namespace {

/// What a request says to a station: which one, the message, and since which minor version it is known.
struct Spoken {
  std::string station;
  std::string session_id;  // the lesson that is meant; empty: whichever
  pb::Envelope message;
  std::uint32_t since_minor = 0;
};

Spoken spokenBy(const pb::Request& request, const std::string& by) {
  Spoken spoken;
  const auto say = [&](const auto& asked, auto& message) {
    message = asked;
    message.set_from(by);
    spoken.station = asked.station();
  };
  if (request.has_trainee_message())
    say(request.trainee_message(), *spoken.message.mutable_trainee_message());
  if (request.has_next_exercise()) say(request.next_exercise(), *spoken.message.mutable_next_exercise());
  if (request.has_set_aids()) {
    say(request.set_aids(), *spoken.message.mutable_set_aids());
    spoken.session_id = request.set_aids().session_id();
    spoken.since_minor = 2;
  }
  if (request.has_stop_lesson()) {
    say(request.stop_lesson(), *spoken.message.mutable_stop_lesson());
    spoken.session_id = request.stop_lesson().session_id();
    spoken.since_minor = 2;
  }
  return spoken;
}

/// Gives the refusal when it did not reach the station, or may not have.
Task<std::optional<pb::Refusal>> deliver(ServerContext& context, const pb::Request& request, std::string by) {
  Spoken spoken = spokenBy(request, by);
  auto* const peer = dynamic_cast<PeerConnection*>(context.hub.stationPeer(spoken.station));
  const std::string name = "station '" + spoken.station + "'";
  if (peer == nullptr) co_return makeRefusal(pb::Refusal::NOT_FOUND, name + " is not online");
  if (peer->version().minor() < spoken.since_minor) {
    // it would answer the ping and pass over what it does not know: that is no delivery
    pb::Refusal refusal =
        makeRefusal(pb::Refusal::VERSION, name + " runs " + printable(peer->program()) + " (protocol " +
                                              versionText(peer->version()) +
                                              "), which does not know that: bring it up to date");
    *refusal.mutable_ours() = ourVersion();
    *refusal.mutable_theirs() = peer->version();
    co_return refusal;
  }
  if (co_await PeerConnection::sendConfirmed(peer->shared_from_this(), std::move(spoken.message)))
    co_return std::nullopt;
  co_return makeRefusal(pb::Refusal::TIMEOUT, name + " did not confirm it within " +
                                                  std::to_string(context.bounds.confirm_timeout.count()) +
                                                  " ms, or its connection ended: it may not have arrived; "
                                                  "say it again when the station is back");
}

/// In the audit log, behind the line that says what was to be delivered.
void noteLater(ServerContext& context, const std::string& who, const std::string& action,
               const std::string& subject, const std::string& detail) {
  asio::post(context.workers, [&service = context.store.service(), who, action, subject, detail] {
    const Status noted = service.note(who, action, subject, detail);
    if (!noted.ok()) logEvent(LogLevel::kError, "audit_failed", {{"text", noted.error().message}});
  });
}

}  // namespace

asio::thread_pool& poolFor(ServerContext& context, const pb::Request& request) {
  switch (request.call_case()) {
    case pb::Request::kAddUser:
    case pb::Request::kSetPassword:
      return context.passwords;
    case pb::Request::kBackup:
    case pb::Request::kCheck:
    case pb::Request::kVerifySession:
    // a class with passwords, a person's years, a whole gesture: seconds
    case pb::Request::kImportPeople:
    case pb::Request::kImportAll:
    case pb::Request::kErasePerson:
    case pb::Request::kRescoreSession:
      return context.slow_workers;
    case pb::Request::kRunRetention:
    case pb::Request::kRescoreAll:
      return context.retention_workers;
    // the engine, and lists over all sessions: tens of milliseconds to seconds, and anybody of the staff may
    case pb::Request::kPreviewProfile:
    case pb::Request::kExportPerson:
    case pb::Request::kExportStudy:
    case pb::Request::kReadStudyRecording:
    case pb::Request::kGetResults:
    case pb::Request::kListScores:
      return context.views;
    default:
      return context.workers;
  }
}

std::shared_ptr<const pb::Request> heldSecretly(pb::Request request) {
  return {new pb::Request(std::move(request)), [](pb::Request* held) {
            if (held->has_add_user()) wipe(*held->mutable_add_user()->mutable_password());
            if (held->has_import_people()) wipe(*held->mutable_import_people()->mutable_csv());
            if (held->has_set_password()) wipe(*held->mutable_set_password()->mutable_password());
            delete held;
          }};
}

Task<std::optional<pb::Refusal>> complete(ServerContext& context, const pb::Request& request, std::string by,
                                          Outcome& outcome) {
  if (outcome.error) co_return refusalOf(*outcome.error);
  std::optional<pb::Refusal> refusal;
  switch (outcome.server_part) {
    case Outcome::ServerPart::kNone:
      break;
    case Outcome::ServerPart::kFillStations:
      context.hub.fillStations(*outcome.reply.mutable_stations());
      break;
    case Outcome::ServerPart::kDeliver:
      refusal = co_await deliver(context, request, by);
      if (refusal)
        noteLater(context, by, "not delivered", spokenBy(request, by).station,
                  std::string(callName(request.call_case())) + ": " + refusal->text());
      break;
  }
  if (!refusal && outcome.reply.result_case() == pb::Reply::RESULT_NOT_SET) outcome.reply.mutable_done();
  co_return refusal;
}

void followUp(ServerContext& context, const pb::Request& request, const pb::Reply& reply,
              const std::string& by, const PeerConnection* asker) {
  if (reply.has_backup_done()) {
    ++context.counters.backups;
    for (const auto& [id, peer] : context.connections) {
      if (peer->who().role == pb::STATION)
        asio::co_spawn(context.io, PeerConnection::tellSafe(peer->shared_from_this()), rethrow);
    }
  }
  if (request.has_revoke_station())
    endAccess(context, request.revoke_station().name(), true, by, nullptr, "the station's key was revoked");
  if (request.has_disable_user() && !request.disable_user().enable())
    endAccess(context, request.disable_user().name(), false, by, nullptr, "the account was disabled");
  // who has another role now goes on with none of the old one's connections, its own least of all
  const char* const changed = "the account was changed: log in again";
  if (request.has_change_user() && (request.change_user().has_role() || request.change_user().disabled())) {
    const bool same = asker != nullptr && reply.user().role() == asker->who().role;
    endAccess(context, request.change_user().name(), false, by, same ? asker : nullptr, changed);
  }
  if (request.has_erase_person())
    endAccess(context, request.erase_person().name(), false, by, nullptr, "the account is no more",
              reply.erasure().pseudonym());
  for (const std::string& name : reply.people_import().roles_changed())
    endAccess(context, name, false, by, nullptr, changed);
  // who sets its own password goes on; its other connections may be those of somebody who knew the old one
  if (request.has_set_password())
    endAccess(context, request.set_password().name(), false, by, asker,
              "the password was changed: log in again");
}

void endAccess(ServerContext& context, const std::string& name, bool station, const std::string& by,
               const PeerConnection* except, const std::string& text, const std::string& said_as) {
  // log-ins that are being checked now are checked again
  ++context.access_changes;
  const std::size_t tokens = station ? 0 : context.tokens.forget(name);
  std::size_t ended = 0;
  // a copy: closing a connection takes it out of the map
  const auto all = context.connections;
  for (const auto& [id, peer] : all) {
    if (peer->who().name != name || (peer->who().role == pb::STATION) != station || peer->over()) continue;
    if (peer == except) continue;
    peer->refuseAndClose(makeRefusal(pb::Refusal::LOGIN, text));
    ++ended;
  }
  const std::string subject = said_as.empty() ? name : said_as;
  logEvent(LogLevel::kInfo, "access_ended",
           {{"name", subject}, {"by", by}, {"connections", ended}, {"tokens", tokens}, {"text", text}});
  if (ended + tokens == 0) return;
  const std::string detail =
      text + "; ended: " + std::to_string(ended) + " connections, " + std::to_string(tokens) + " tokens";
  noteLater(context, by, "access ended", subject, detail);
}

}  // namespace needlelab
