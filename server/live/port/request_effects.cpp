#include "server/live/port/request_effects.h"

#include <fmt/core.h>
#include <algorithm>
#include <boost/asio/post.hpp>
#include <utility>

#include "common/base/time/clock.h"
#include "common/wire/protocol.h"
#include "db/service/requests/requests.h"
#include "proto/session_rules.h"
#include "server/base/log.h"
#include "server/live/counters.h"
#include "server/live/hub/hub.h"
#include "server/live/limits/server_limits.h"
#include "server/live/login/login_state.h"
#include "server/live/port/live_peer.h"
#include "server/live/work/server_work.h"
#include "server/live/work/turn_queue.h"
#include "server/together/server_together.h"

namespace needlelab {
namespace {

/// A request's message to a station.
struct StationMessage {
  std::string station;
  pb::Envelope message;
};

StationMessage stationMessageOf(const pb::Request& request, const std::string& by) {
  StationMessage wanted;
  const auto copyOf = [&](const auto& asked, auto& message) {
    message = asked;
    message.set_from(by);
    wanted.station = asked.station();
  };
  if (request.has_trainee_message())
    copyOf(request.trainee_message(), *wanted.message.mutable_trainee_message());
  if (request.has_next_exercise()) copyOf(request.next_exercise(), *wanted.message.mutable_next_exercise());
  if (request.has_set_aids()) copyOf(request.set_aids(), *wanted.message.mutable_set_aids());
  if (request.has_stop_lesson()) copyOf(request.stop_lesson(), *wanted.message.mutable_stop_lesson());
  return wanted;
}

/// Returns a refusal if the message did not, or may not have, reached the station.
Task<std::optional<pb::Refusal>> deliverLocally(ServerContext& context, std::string station,
                                                pb::Envelope message) {
  auto* const peer = dynamic_cast<LivePeer*>(context.hub.stationPeer(station));
  const std::string name = "station '" + station + "'";
  if (peer == nullptr) {
    const std::string trouble =
        context.together.remote != nullptr ? context.together.remote->trouble() : std::string();
    co_return makeRefusal(pb::Refusal::NOT_FOUND,
                          trouble.empty() ? name + " is not online"
                                          : name + " is not connected to this server, and " + trouble +
                                                ": if it is at another server, try again when that is over");
  }
  if (co_await peer->sendConfirmed(std::move(message))) co_return std::nullopt;
  co_return makeRefusal(pb::Refusal::TIMEOUT,
                        fmt::format("{} did not confirm it within {} ms, or its connection ended: it may not "
                                    "have arrived; send it again when the station is back",
                                    name, context.limits.bounds.confirm_timeout.count()));
}

/// For a station at another server. Nothing: it is connected here now.
Task<std::optional<RemoteLive::Asked>> deliverRemotely(ServerContext& context, const StationMessage& wanted) {
  auto later = std::make_shared<Later<RemoteLive::Asked>>(context.io.get_executor());
  RemoteLive::AskDone done = [later](RemoteLive::Asked asked) { later->set(std::move(asked)); };
  context.together.remote->ask(wanted.station, wanted.message, std::move(done));
  RemoteLive::Asked asked = co_await Later<RemoteLive::Asked>::wait(std::move(later));
  if (asked.kind == RemoteLive::Asked::Kind::kLocal) co_return std::nullopt;
  co_return std::move(asked);
}

Task<std::optional<pb::Refusal>> deliver(ServerContext& context, const pb::Request& request, std::string by) {
  StationMessage wanted = stationMessageOf(request, by);
  if (context.together.remote != nullptr && context.together.remote->isRemote(wanted.station)) {
    if (auto asked = co_await deliverRemotely(context, wanted)) {
      if (asked->kind == RemoteLive::Asked::Kind::kDelivered) co_return std::nullopt;
      co_return std::move(asked->refusal);
    }
  }
  co_return co_await deliverLocally(context, std::move(wanted.station), std::move(wanted.message));
}

Task<> deliverThenReport(ServerContext& context, std::string station, pb::Envelope message,
                         RemoteLive::DeliverDone done) {
  auto refusal = co_await deliverLocally(context, std::move(station), std::move(message));
  done(std::move(refusal));
}

/// Adds to the audit log, after the line with the intended delivery.
void addToAuditLog(ServerContext& context, const Doer& who, const std::string& action,
                   const std::string& subject, const std::string& detail) {
  context.store.service().notes().noteSoon(who, action, subject, detail, [](const Error& error) {
    logEvent(LogLevel::kError, "audit_failed", {{"text", error.message}});
  });
}

using Executed = std::shared_ptr<Outcome>;

PasswordLine passwordLineOf(const Principal& who) {
  return who.role == pb::STATION ? kStationLine : kPersonLine;
}

/// Whether the peer may queue another hash. A station shows this text to the trainee (kCode); on any other
/// refusal it would start the lesson from its cache.
Status mayWait(ServerContext& context, RequestThreads threads, const Principal& who) {
  const std::size_t most = context.limits.bounds.hashes_waiting;
  if (threads != RequestThreads::kPasswords ||
      context.work.password_pool->waitingOf(who.name, passwordLineOf(who)) < most)
    return {};
  return Error{
      who.role == pb::STATION ? ErrorCode::kCode : ErrorCode::kUnavailable,
      fmt::format("{} passwords and codes of this {} wait to be computed already: try again when one "
                  "of them is done",
                  most, who.role == pb::STATION ? "station" : "account")};
}

std::shared_ptr<Outcome> refusalOutcome(const pb::Request& request, Error error) {
  auto refused = std::make_shared<Outcome>();
  refused->error = std::move(error);
  refused->reply.set_id(request.id());
  return refused;
}

/// `has_place`: the work has a place for long scores; it takes turns separately from the person's other work.
Task<Executed> onItsThreads(ServerContext& context, RequestThreads threads, const Principal& who,
                            std::function<Executed()> work, bool has_place) {
  switch (threads) {
    case RequestThreads::kWorkers:
      break;
    case RequestThreads::kPasswords:
      return offload(*context.work.password_pool, who.name, std::move(work), passwordLineOf(who));
    case RequestThreads::kViews:
      return offload(
          who.role == pb::STATION ? *context.work.views_of_stations : *context.work.views_of_people,
          turnNameOf(who), std::move(work));
    case RequestThreads::kSlow:
    case RequestThreads::kScores:
      return offload(*context.work.slow_workers_of_people, turnNameOf(who) + (has_place ? ", score" : ""),
                     std::move(work));
    case RequestThreads::kHours:
      return offload(context.work.retention_workers, std::move(work));
  }
  return offload(*context.work.workers_of_people, turnNameOf(who), std::move(work));
}

constexpr const char* kAccountChanged = "the account was changed: log in again";

/// Ends the connections for which `are` is true. Returns their number.
std::size_t closeMatching(ServerContext& context, const std::string& text,
                          const std::function<bool(const LivePeer&)>& are) {
  std::size_t count = 0;
  // copy: closing a connection removes it from the map
  const auto all = context.connections;
  for (const auto& [id, peer] : all) {
    if (peer->over() || !are(*peer)) continue;
    peer->refuseAndClose(makeRefusal(pb::Refusal::LOGIN, text));
    ++count;
  }
  return count;
}

}  // namespace

Result<DiskRoom::Share> takeRoom(ServerContext& context, const Principal& who, pb::Request::CallCase call,
                                 std::size_t bytes) {
  const Storing storing = storingOf(call);
  if (storing == Storing::kNothing) return DiskRoom::Share();
  if (who.role != pb::STATION)
    RETURN_IF_ERROR(context.limits.shares.admit(who.name, who.role, bytes, steadyNowNs()));
  // before the check, so that a flood between two looks at the disk counts, too
  DiskRoom::Share room = context.limits.disk_room.share(bytes + PeopleShares::kRequestBytes);
  const bool refused = storing == Storing::kNeeded ? context.limits.disk_room.atLastFloor()
                                                   : context.limits.disk_room.level() == RoomLevel::kNoChunks;
  if (refused) return Error{ErrorCode::kNoRoom, context.limits.disk_room.text()};
  return room;
}

Task<Executed> executeRequest(ServerContext& context, Principal who,
                              std::shared_ptr<const pb::Request> request, std::function<bool()> gone) {
  const RequestThreads threads = threadsOf(*request, who.role);
  if (const Status may = mayWait(context, threads, who); !may.ok())
    co_return refusalOutcome(*request, may.error());
  auto room = takeRoom(context, who, request->call_case(), request->ByteSizeLong());
  if (!room.ok()) co_return refusalOutcome(*request, room.error());
  std::unique_ptr<TurnQueue::Place> place;
  const auto under_way = std::make_shared<RequestUnderWay>();
  const std::function<Executed()> step = [&service = context.store.service(), who, request, threads,
                                          under_way, gone = std::move(gone)]() -> Executed {
    // once done, continue: others must be notified, e.g. people who lost access
    if (!under_way->isDone() && gone())
      return refusalOutcome(*request, {ErrorCode::kUnavailable, "the client has disconnected"});
    if (threads == RequestThreads::kHours) yieldThread();
    auto outcome = service.executeStep(who, *request, *under_way);
    return outcome ? std::make_shared<Outcome>(*std::move(outcome)) : nullptr;
  };
  bool is_ended = false;
  for (;;) {
    std::function<Executed()> work = step;
    const Executed done = co_await onItsThreads(context, threads, who, std::move(work), bool{place});
    // at once, because the remaining steps may take long
    if (under_way->isDone() && !std::exchange(is_ended, true)) {
      const std::string& ref = under_way->with_refs->erase_person().name();
      context.hub.forgetTrainee(ref);
      endAccess(context, {.name = ref, .text = "the account is no more"}, who.doer());
    }
    if (!done) {
      if (under_way->is_long && !place) place = co_await context.work.rescorings.take(turnNameOf(who));
      continue;
    }
    if (!done->error) room->stored();
    co_return done;
  }
}

Task<Result<CloseOutcome>> closeQueued(ServerContext& context, std::string station, CloseWork work) {
  using Step = Result<std::optional<CloseOutcome>>;
  const Error disconnected{ErrorCode::kUnavailable, "the client has disconnected"};
  std::unique_ptr<TurnQueue::Place> place;
  for (;;) {
    const bool is_long = work.is_long && work.is_long();
    if (is_long && !place) place = co_await context.work.long_scores.take(station);
    if (work.gone()) co_return disconnected;
    std::function<Step()> piece = [work, disconnected]() -> Step {
      return work.gone() ? disconnected : work.step();
    };
    FairPool& turns = is_long ? *context.work.long_scores_by_station : *context.work.closes_by_station;
    Step done = co_await offload(turns, station, std::move(piece));
    if (!done.ok()) co_return done.error();
    if (done->has_value()) co_return std::move(**done);
  }
}

RemoteLive::Deliver remoteDelivery(ServerContext& context) {
  return [&context](const std::string& station, const pb::Envelope& message, RemoteLive::DeliverDone done) {
    asio::co_spawn(context.io, deliverThenReport(context, station, message, std::move(done)), rethrow);
  };
}

FairPool* poolForWriting(const ServerContext& context, std::size_t reply_bytes) {
  if (reply_bytes <= 16u << 10) return nullptr;
  return reply_bytes < 64u << 10 ? context.work.workers_of_people.get() : context.work.views_of_people.get();
}

BudgetOwner budgetOwner(const Principal& who) {
  return {turnNameOf(who), who.role != pb::STATION};
}

Task<std::optional<ByteBudget::Share>> waitForRoom(ByteBudget& budget, std::shared_ptr<Signal> freed,
                                                   Principal who, std::size_t bytes,
                                                   std::function<bool()> gone) {
  const BudgetOwner owner = budgetOwner(who);
  while (!gone()) {
    if (auto share = budget.take(owner, bytes)) co_return std::move(share);
    co_await freed->wait();
  }
  co_return std::nullopt;
}

std::size_t replyRoomOf(const ServerContext& context, const Principal& who, pb::Request::CallCase call) {
  constexpr std::size_t kDoneBytes = 4u << 10;
  const RequestRow* const row = requestRow(call);
  const bool done_only = row != nullptr && row->reply == pb::Reply::kDone;
  return std::min(done_only ? kDoneBytes : kMaxFrameBytes,
                  context.in_flight.replies.mostBytes(budgetOwner(who)));
}

std::shared_ptr<const pb::Request> wipedWhenReleased(pb::Request request) {
  return {new pb::Request(std::move(request)), [](pb::Request* held) {
            wipeSecrets(*held);
            delete held;
          }};
}

Task<std::optional<pb::Refusal>> complete(ServerContext& context, const pb::Request& request, Doer by,
                                          Outcome& outcome) {
  if (outcome.error) co_return refusalOf(*outcome.error);
  std::optional<pb::Refusal> refusal;
  switch (outcome.server_part) {
    case ServerPart::kNone:
      break;
    case ServerPart::kFillStations:
      context.hub.fillStations(*outcome.reply.mutable_stations());
      break;
    case ServerPart::kDeliver:
      refusal = co_await deliver(context, request, by.shown.empty() ? by.name : by.shown);
      if (refusal)
        addToAuditLog(context, by, "not delivered", stationMessageOf(request, by.name).station,
                      std::string(callName(request.call_case())) + ": " + refusal->text());
      break;
  }
  if (!refusal && outcome.reply.result_case() == pb::Reply::RESULT_NOT_SET) outcome.reply.mutable_done();
  co_return refusal;
}

void sendSafe(ServerContext& context) {
  // copy: ending a connection removes it from the map
  const auto all = context.connections;
  for (const auto& [id, peer] : all) {
    if (peer->who().role == pb::STATION) peer->sendSafe();
  }
}

void followUp(ServerContext& context, const Outcome& outcome, const Doer& by, const LivePeer* asker) {
  if (outcome.reply.has_backup_done()) {
    ++context.counters.backups;
    sendSafe(context);
  }
  for (const std::string& ref : outcome.roles_changed)
    endAccess(context, {.name = ref, .text = kAccountChanged}, by);
  // a request that changes nothing must not disturb log-ins
  if (!outcome.access_changed || !outcome.with_refs) return;
  const pb::Request& request = *outcome.with_refs;
  if (request.has_revoke_station())
    endAccess(context,
              {.name = request.revoke_station().name(),
               .is_station = true,
               .text = "the station's key was revoked"},
              by);
  if (request.has_disable_user())
    endAccess(context, {.name = request.disable_user().name(), .text = "the account was disabled"}, by);
  // all connections of a person with a new role, including the requester's own
  if (request.has_change_user())
    endAccess(context, {.name = request.change_user().name(), .text = kAccountChanged}, by);
  // keep the connection on which people set their own password; users of their other connections may only
  // know the old one
  if (request.has_set_password())
    endAccess(context,
              {.name = request.set_password().name(),
               .except = asker,
               .text = "the password was changed: log in again"},
              by);
}

void endAccess(ServerContext& context, const EndedAccess& ended, const Doer& by) {
  // log-ins in progress are checked again
  context.logins.access.changed(ended.name, ended.is_station);
  const auto tokens = ended.is_station ? std::size_t{0} : context.logins.state->forget(ended.name);
  const std::size_t connections = closeMatching(context, ended.text, [&](const LivePeer& peer) {
    const Principal& who = peer.who();
    return who.name == ended.name && (who.role == pb::STATION) == ended.is_station && &peer != ended.except &&
           who.access_number.value_or(-1) < ended.before_number;
  });
  // no line if nothing changed: such requests may be repeated endlessly
  if (connections + tokens.value_or(0) == 0) return;
  const std::string& subject = ended.name;
  const LogField of_tokens = tokens ? LogField("tokens", *tokens) : LogField("tokens", "all");
  logEvent(
      LogLevel::kInfo, "access_ended",
      {{"name", subject}, {"by", by.name}, {"connections", connections}, of_tokens, {"text", ended.text}});
  const std::string detail =
      tokens ? fmt::format("{}; ended: {} connections, {} tokens", ended.text, connections, *tokens)
             : fmt::format("{}; ended: {} connections to this server, all tokens", ended.text, connections);
  addToAuditLog(context, by, "access ended", subject, detail);
}

void endAccessOf(ServerContext& context, const Principal& who) {
  const bool is_station = who.role == pb::STATION;
  context.logins.access.changed(who.name, is_station);
  if (!is_station) (void)context.logins.state->forget(who.name);
  const std::size_t connections = closeMatching(context, kAccountChanged, [&](const LivePeer& peer) {
    const Principal& there = peer.who();
    return there.name == who.name && there.role == who.role && there.access_number == who.access_number;
  });
  if (connections > 0)
    logEvent(LogLevel::kInfo, "access_ended",
             {{"connections", connections}, {"text", "the account was changed at another server"}});
}

}  // namespace needlelab
