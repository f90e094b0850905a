// The durable plane of a connection: sessions. Chunks and acknowledgements: connection_chunks.cpp.
#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "common/base/time/clock.h"
#include "common/wire/protocol.h"
#include "db/people/person_refs.h"
#include "server/base/log.h"
#include "server/live/counters.h"
#include "server/live/hub/hub.h"
#include "server/live/limits/server_limits.h"
#include "server/live/port/clock_offsets.h"
#include "server/live/port/connection.h"
#include "server/live/port/request_effects.h"
#include "server/live/work/server_work.h"

namespace needlelab {

Result<Uuid> PeerConnection::sessionIdOf(const std::string& bytes) {
  Uuid id{};
  if (bytes.size() != id.size()) {
    return Error{ErrorCode::kInvalidInput, fmt::format("session_id has {} bytes, not 16", bytes.size())};
  }
  std::copy(bytes.begin(), bytes.end(), id.begin());
  return id;
}

std::string PeerConnection::sessionText(const std::string& bytes) {
  const auto id = sessionIdOf(bytes);
  return id.ok() ? uuidText(*id) : "invalid";
}

pb::Refusal PeerConnection::sessionRefusal(pb::Refusal::Reason reason, std::string text,
                                           const std::string& session_id, std::uint64_t expected_seq) {
  pb::Refusal refusal = makeRefusal(reason, std::move(text));
  nameSession(refusal, session_id);
  refusal.set_expected_seq(expected_seq);
  return refusal;
}

PeerConnection::Watermarks& PeerConnection::watermarks(const std::string& session_id) {
  // ids are ordered by time (UUIDv7): drop the oldest one without a pending acknowledgement
  if (sessions_.size() >= context_.limits.bounds.known_sessions && !sessions_.contains(session_id)) {
    const auto oldest = std::find_if(sessions_.begin(), sessions_.end(),
                                     [](const auto& entry) { return !entry.second.ack_due; });
    if (oldest != sessions_.end()) sessions_.erase(oldest);
  }
  return sessions_[session_id];
}

Task<> PeerConnection::openSession(pb::OpenSession request) {
  auto self = shared_from_this();
  const pb::SessionDescription& description = request.description();
  const std::string session_id = description.session_id();
  const auto id = sessionIdOf(session_id);
  if (!id.ok()) {
    refuse(sessionRefusal(pb::Refusal::INVALID, id.error().message, session_id));
    co_return;
  }
  if (description.station() != who_.name) {
    refuse(sessionRefusal(
        pb::Refusal::INVALID,
        "open_session.station '" + description.station() + "' is not this station, '" + who_.name + "'",
        session_id));
    co_return;
  }

  // commit before answering: a session announced to a station survives the server
  struct Opened {
    std::uint64_t next_seq = 0, safe = 0, max_safe = 0;
    bool is_new = false, closed = false;
    std::string trainee_ref, trainee, full_name;
    bool begin_unsure = false;
  };
  auto opened = std::make_shared<Opened>();
  DiskRoom::Share disk_room = context_.limits.disk_room.share(description.ByteSizeLong());
  DbWriter::Work work = [opened, description, id = *id, claim = claim_, &quotas = context_.limits.quotas,
                         room = context_.limits.disk_room.level(),
                         no_room = context_.limits.disk_room.text()](Connection& writer) -> Status {
    RETURN_IF_ERROR(StationClaims(writer).require(claim.get()));
    SessionStore store(writer);
    ASSIGN_OR_RETURN(const auto arrival, store.arrivalOf(description));
    opened->is_new = arrival.state == SessionArrival::State::kNew;
    // a closed session needs no room: its station only asks whether it exists
    const bool needs_room =
        arrival.state == SessionArrival::State::kNew
            ? room >= RoomLevel::kNoNewSessions
            : arrival.state == SessionArrival::State::kOpen && room >= RoomLevel::kNoChunks;
    if (needs_room) return Error{ErrorCode::kNoRoom, no_room};
    if (arrival.state != SessionArrival::State::kClosed)
      RETURN_IF_ERROR(quotas.roomForChunks(description.station(), steadyNowNs()));
    ASSIGN_OR_RETURN(auto next, store.open(description, wallNowNs()));
    // last: an error rolls the session back, and an invalid session costs its station nothing
    if (opened->is_new)
      RETURN_IF_ERROR(quotas.admit(description.station(),
                                   {.open_sessions = arrival.open_sessions,
                                    .description_bytes = description.ByteSizeLong(),
                                    .unknown_name = arrival.unknown_name},
                                   steadyNowNs()));
    opened->next_seq = next;
    ASSIGN_OR_RETURN(auto safe, store.safeSeqs(id));
    opened->safe = safe;
    ASSIGN_OR_RETURN(opened->max_safe, store.mostSafeSeqs(id));
    auto state = writer.query(
        "SELECT state, trainee, EXISTS (SELECT 1 FROM unknown_trainees WHERE session = number AND"
        " by_whom IS NULL AND begin_unsure = 1) FROM sessions WHERE id = ?",
        ByteView(id));
    ASSIGN_OR_RETURN(const auto found, state.step());
    opened->closed = found && state.integer(0) != pb::SESSION_OPEN;
    opened->trainee_ref = state.text(1);
    opened->begin_unsure = state.integer(2) != 0;
    ASSIGN_OR_RETURN(opened->trainee, shownName(writer, opened->trainee_ref));
    std::map<std::string, std::string> full;
    RETURN_IF_ERROR(namesOfRefs(writer, {{opened->trainee_ref}}, &full));
    opened->full_name = full[opened->trainee_ref];
    return {};
  };
  const Status status = co_await commit(context_.store.writer(), std::move(work));
  if (status.ok() && opened->is_new) disk_room.stored();
  if (channel_->closing() || endedAsDeposed(status)) co_return;
  if (!status.ok()) {
    pb::Refusal refusal = refusalOf(status.error());
    nameSession(refusal, session_id);
    refuse(std::move(refusal));
    co_return;
  }
  if (opened->is_new && opened->begin_unsure)
    note(PeerLine::kClockOfStation,
         {{"conn", id_},
          {"who", who_.name},
          {"session", uuidText(*id)},
          {"began", utcTime(description.started_unix_ns())},
          {"text", "the station's clock was wrong: the session waits for a manager"}});
  Watermarks& marks = watermarks(session_id);
  marks.committed = 0;  // a restored store may have fewer than before
  marks.safe = opened->safe;
  marks.max_safe = opened->max_safe;
  marks.noteCommitted(opened->next_seq, context_.acks_are_safe);
  // also for a closed session: its station may have missed the answer to CloseSession and sends it again
  marks.open = true;
  marks.trainee_ref = opened->trainee_ref;
  marks.trainee = opened->closed ? std::string() : opened->trainee;
  marks.full_name = opened->full_name;
  if (state_ == ConnectionState::kAuthenticated) setState(ConnectionState::kInSession);
  // for a closed session, which includes all of erased people, the station only asks whether it still exists
  if (!opened->closed && isStationsPeer()) context_.hub.onSession(who_.name, session_id, opened->trainee_ref);
  note(opened->closed ? PeerLine::kSessionConfirmed : PeerLine::kSessionOpened,
       {{"conn", id_},
        {"session", sessionText(session_id)},
        {"station", who_.name},
        {"trainee", opened->trainee_ref},
        {"exercise", description.exercise_id()},
        {"next_seq", opened->next_seq}});
  pb::Envelope envelope;
  envelope.mutable_session_opened()->set_session_id(session_id);
  envelope.mutable_session_opened()->set_next_seq(opened->next_seq);
  sendControl(envelope);
  marks.ack_due = true;
  sendAcks();
}

/// Whether the hub knows this connection as the station's; another server may have taken it over.
bool PeerConnection::isStationsPeer() const {
  return context_.hub.stationPeer(who_.name) == this;
}

std::optional<pb::Refusal> PeerConnection::onStationStatus(pb::StationStatus status) {
  // an erased person's session is closed; this also works after a restart, when the erased names are unknown
  const auto session = sessions_.find(status.session_id());
  if (session == sessions_.end() || context_.hub.isErased(session->second.trainee_ref))
    forgetTraineeOf(status);
  else {
    status.set_trainee(session->second.trainee);
    status.set_trainee_full_name(session->second.full_name);
  }
  return isStationsPeer() ? context_.hub.onStatus(who_.name, status, steadyNowNs()) : std::nullopt;
}

void PeerConnection::onCloseSession(pb::CloseSession request) {
  const std::string& session_id = request.session_id();
  if (const auto id = sessionIdOf(session_id); !id.ok()) {
    refuse(pb::Refusal::INVALID, "close_session." + id.error().message);
    return;
  }
  if (const std::size_t bytes = request.hash().size(); bytes != 0 && bytes != Digest{}.size()) {
    refuse(sessionRefusal(
        pb::Refusal::INVALID,
        fmt::format("close_session.hash has {} bytes, not {} or none", bytes, Digest{}.size()), session_id));
    return;
  }
  if (closing_sessions_.contains(session_id)) return;  // already in progress: one answer serves both
  // refused, because chunks, messages and requests of this connection must still be read
  auto place = context_.limits.closes.take({.name = who_.name, .person = false}, 1);
  if (!place) {
    refuse(sessionRefusal(
        pb::Refusal::RATE_LIMITED,
        fmt::format("{} sessions of this station are being closed: close this one a little later",
                    context_.limits.bounds.closes_of_station),
        session_id));
    return;
  }
  closing_sessions_.insert(session_id);
  // a copy: discarding does not free the memory, and the message's share of the budget ends now
  request.DiscardUnknownFields();
  asio::co_spawn(context_.io, closeSession(shared_from_this(), pb::CloseSession(request), std::move(place)),
                 endOnException(shared_from_this()));
}

Task<> PeerConnection::closeSession(std::shared_ptr<PeerConnection> self, pb::CloseSession request,
                                    std::optional<ByteBudget::Share> place) {
  PeerConnection& peer = *self;
  const std::string session_id = request.session_id();

  // wait for earlier chunks: an empty work item completes after all earlier items are committed
  DbWriter::Work nothing = [](Connection&) { return Status{}; };
  const Status committed = co_await commit(peer.context_.store.writer(), std::move(nothing));
  Service& service = peer.context_.store.service();
  const auto close = std::make_shared<CloseUnderWay>(CloseUnderWay{std::move(request), peer.who_.name});
  close->claim = peer.claim_;
  CloseWork work;
  work.step = [&service, close] { return service.scoring().closeStep(*close); };
  work.gone = [gone = peer.gone_] { return gone->load(); };
  work.is_long = [close] { return close->is_long; };
  Result<CloseOutcome> outcome = Error{ErrorCode::kFailed, "not done"};
  if (committed.ok()) {
    outcome = co_await closeQueued(peer.context_, peer.who_.name, std::move(work));
  } else {
    outcome = committed.error();
  }
  place.reset();
  peer.closing_sessions_.erase(session_id);
  peer.freed_.notify();

  if (!outcome.ok()) {
    if (peer.gone()) co_return;  // the station asks again on its next connection
    if (peer.endedAsDeposed(outcome.error())) co_return;
    pb::Refusal refusal = refusalOf(outcome.error());
    nameSession(refusal, session_id);
    peer.refuse(std::move(refusal));
    co_return;
  }
  const Closed& closed = outcome->closed;
  if (!closed.taken()) {
    const auto reason = closed.kind == Closed::Kind::kIncomplete      ? pb::Refusal::GAP
                        : closed.kind == Closed::Kind::kContradiction ? pb::Refusal::CONTRADICTION
                                                                      : pb::Refusal::UNKNOWN_SESSION;
    peer.refuse(sessionRefusal(reason, closed.text, session_id, closed.next_seq));
    co_return;
  }
  ++peer.context_.counters.sessions_closed;
  if (const std::uint64_t bytes = outcome->event_bytes; bytes > 0) {
    // events are made from its chunks and charged to the station likewise
    peer.context_.limits.disk_room.share(bytes).stored();
    static_cast<void>(peer.context_.store.writer().post(
        [bytes, station = peer.who_.name, &quotas = peer.context_.limits.quotas](Connection&) -> Status {
          return quotas.admitChunk(station, {.bytes = bytes, .undecodable = false}, steadyNowNs());
        },
        {}));
  }
  peer.note(PeerLine::kSessionClosed,
            {{"conn", peer.id_},
             {"session", sessionText(session_id)},
             {"station", peer.who_.name},
             {"state", pb::SessionState_Name(closed.state)},
             {"chunks", closed.next_seq},
             {"score_fault", outcome->score_fault.empty() ? "none" : outcome->score_fault}});
  pb::Envelope envelope;
  pb::SessionClosed& answer = *envelope.mutable_session_closed();
  answer.set_session_id(session_id);
  answer.set_state(closed.state);
  answer.set_score_json(outcome->score_json);
  peer.sendControl(envelope);

  peer.watermarks(session_id).open = false;
  const bool any_open = std::any_of(peer.sessions_.begin(), peer.sessions_.end(),
                                    [](const auto& entry) { return entry.second.open; });
  if (!any_open && peer.state_ == ConnectionState::kInSession) peer.setState(ConnectionState::kAuthenticated);
}

void PeerConnection::onClockOffset(const pb::ClockOffset& offset) {
  const auto id = sessionIdOf(offset.session_id());
  if (!id.ok() || !sessions_.contains(offset.session_id())) {
    refuse(sessionRefusal(pb::Refusal::UNKNOWN_SESSION, "clock_offset: not a session of this connection",
                          offset.session_id()));
    return;
  }
  if (offset.round_trip_ns() <= 0) {
    refuse(sessionRefusal(
        pb::Refusal::INVALID,
        fmt::format("clock_offset.round_trip_ns is {}, allowed is above 0", offset.round_trip_ns()),
        offset.session_id()));
    return;
  }
  context_.clock_offsets.put(context_.store.writer(), *id, offset.offset_ns(), offset.round_trip_ns(),
                             claim_);
}

/// If the station has logged in again since, nothing from this connection is stored. Ends it, so that the
/// station resends unacknowledged data to its current server.
bool PeerConnection::endedAsDeposed(const Status& status) {
  if (status.ok() || status.error().code != ErrorCode::kDeposed) return false;
  if (over()) return true;
  ++context_.counters.stations_deposed;
  note(PeerLine::kStationDeposed, {{"conn", id_}, {"station", who_.name}, {"text", status.error().message}});
  refuseAndClose(makeRefusal(pb::Refusal::DEPOSED, status.error().message));
  return true;
}

/// Ends the connection only if the database agrees: other servers are trusted for views only.
Task<> PeerConnection::checkClaim(std::shared_ptr<PeerConnection> self) {
  PeerConnection& peer = *self;
  std::function<Result<std::string>()> look = [&store = peer.context_.store,
                                               claim = peer.claim_]() -> Result<std::string> {
    ASSIGN_OR_RETURN(auto reader, store.readers().borrow());
    const Status holds = StationClaims(*reader).require(claim.get());
    if (holds.ok()) return std::string();
    if (holds.error().code == ErrorCode::kDeposed) return holds.error().message;
    return holds.error();
  };
  const auto lost = co_await offload(*peer.context_.work.login_pool, turnNameOf(peer.who_), std::move(look));
  if (lost.ok() && !lost->empty() && !peer.over())
    (void)peer.endedAsDeposed(Error{ErrorCode::kDeposed, *lost});
}

void PeerConnection::onDisplaced() {
  asio::co_spawn(context_.io, checkClaim(shared_from_this()), endOnException(shared_from_this()));
}

}  // namespace needlelab
