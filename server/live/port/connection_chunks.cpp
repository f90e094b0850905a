// The durable plane of a connection: chunks, acknowledgements.
#include <algorithm>
#include <boost/asio/post.hpp>
#include <utility>

#include "common/base/time/clock.h"
#include "common/wire/protocol.h"
#include "server/base/log.h"
#include "server/live/counters.h"
#include "server/live/hub/hub.h"
#include "server/live/limits/server_limits.h"
#include "server/live/port/connection.h"
#include "server/live/work/server_work.h"

namespace needlelab {

void PeerConnection::onChunk(pb::Chunk chunk) {
  const auto id = sessionIdOf(chunk.session_id());
  if (!id.ok()) {
    refuse(sessionRefusal(pb::Refusal::INVALID, id.error().message, chunk.session_id()));
    return;
  }
  if (context_.limits.disk_room.level() == RoomLevel::kNoChunks) {
    // ends the connection, so that the station resends everything after this chunk; then opening its session
    // is refused, which the station retries
    ++context_.counters.refused_for_room;
    refuseAndClose(sessionRefusal(pb::Refusal::NO_ROOM, context_.limits.disk_room.text(), chunk.session_id(),
                                  chunk.seq()));
    return;
  }
  context_.limits.disk_room.take(chunk.data().size());
  ++chunks_in_flight_;
  const BudgetOwner owner{.name = who_.name, .person = false};
  context_.in_flight.chunks.add(owner, 1);
  context_.in_flight.chunk_bytes.add(owner, chunk.data().size());
  struct Waiting {
    pb::Chunk chunk;
    std::string station;
    std::shared_ptr<const StationClaim> claim;
    Appended appended;
  };
  // copy only these: the budget does not count the other fields while the chunk waits
  const auto waiting = std::make_shared<Waiting>();
  waiting->chunk.set_session_id(chunk.session_id());
  waiting->chunk.set_seq(chunk.seq());
  waiting->chunk.set_data(std::move(*chunk.mutable_data()));
  waiting->station = who_.name;
  waiting->claim = claim_;
  const pb::Chunk& known = waiting->chunk;
  ArrivedChunk arrived{*id, known.seq(), viewOf(known.data()), waiting->station, &waiting->appended};
  arrived.claim = waiting->claim.get();
  arrived.admit = [kept = waiting.get(), &quotas = context_.limits.quotas](const Appended& appended) {
    return quotas.admitChunk(kept->station,
                             {.bytes = kept->chunk.data().size(), .undecodable = appended.quarantined},
                             steadyNowNs());
  };
  // called on the writer's thread, after the commit
  DbWriter::Done done = [self = shared_from_this(), waiting](const Status& status) {
    self->context_.in_flight.committed.put(
        [self, waiting, status] { self->chunkDone(waiting->chunk, status, waiting->appended); });
  };
  if (const Status posted = context_.store.writer().postChunk(std::move(arrived), std::move(done));
      !posted.ok()) {
    chunkDone(waiting->chunk, posted, waiting->appended);
  }
}

void PeerConnection::chunkDone(const pb::Chunk& chunk, const Status& status, const Appended& appended) {
  --chunks_in_flight_;
  context_.limits.disk_room.settle(chunk.data().size(),
                                   status.ok() && appended.kind == Appended::Kind::kStored);
  const bool was_full = context_.in_flight.chunksFull();
  const BudgetOwner owner{.name = who_.name, .person = false};
  context_.in_flight.chunks.giveBack(owner, 1);
  context_.in_flight.chunk_bytes.giveBack(owner, chunk.data().size());
  if (was_full && !context_.in_flight.chunksFull()) context_.in_flight.chunk_room.notify();
  freed_.notify();
  // the station may have logged in again, and its newer connection may wait for this chunk's place
  auto* const newer = dynamic_cast<PeerConnection*>(context_.hub.stationPeer(who_.name));
  if (newer != nullptr && newer != this) newer->freed_.notify();
  if (endedAsDeposed(status)) return;
  if (!status.ok() && status.error().code == ErrorCode::kNoRoom) {
    // its station's share is used up; handled like a full disk
    ++context_.counters.refused_for_room;
    if (over()) return;
    note(PeerLine::kNoRoom, {{"conn", id_}, {"who", who_.name}, {"text", status.error().message}});
    refuseAndClose(
        sessionRefusal(pb::Refusal::NO_ROOM, status.error().message, chunk.session_id(), chunk.seq()));
    return;
  }
  if (!status.ok()) {
    // not stored and not acknowledged: the station keeps the chunk and resends it on its next connection
    logEvent(LogLevel::kError, "chunk_not_stored",
             {{"conn", id_},
              {"session", sessionText(chunk.session_id())},
              {"seq", chunk.seq()},
              {"text", status.error().message}});
    refuseAndClose(sessionRefusal(pb::Refusal::INTERNAL,
                                  "the chunk could not be stored: " + status.error().message,
                                  chunk.session_id(), chunk.seq()));
    return;
  }
  if (!appended.taken()) {
    refuseChunk(chunk, appended);
    return;
  }
  ++(appended.kind == Appended::Kind::kStored ? context_.counters.chunks_stored
                                              : context_.counters.chunks_repeated);
  if (appended.quarantined) {
    ++context_.counters.chunks_quarantined;
    note(PeerLine::kChunkQuarantined, {{"conn", id_},
                                       {"station", who_.name},
                                       {"session", sessionText(chunk.session_id())},
                                       {"seq", chunk.seq()},
                                       {"text", appended.text}});
  }
  Watermarks& marks = watermarks(chunk.session_id());
  if (appended.quarantined) marks.max_safe = std::min(marks.max_safe, chunk.seq());
  marks.noteCommitted(appended.next_seq, context_.acks_are_safe);
  marks.ack_due = true;
  scheduleAcks();
}

void PeerConnection::refuseChunk(const pb::Chunk& chunk, const Appended& appended) {
  ++context_.counters.chunks_refused;
  const bool contradicts = appended.kind == Appended::Kind::kContradiction;
  if (contradicts) ++context_.counters.chunks_contradicting;
  // after a chunk that ended the connection, all others of its session are gaps or contradict likewise; one
  // line is enough
  if (over() && (contradicts || appended.kind == Appended::Kind::kGap)) return;
  const auto reason = [&] {
    switch (appended.kind) {
      case Appended::Kind::kGap:
        return pb::Refusal::GAP;
      case Appended::Kind::kContradiction:
        return pb::Refusal::CONTRADICTION;
      case Appended::Kind::kUnknownSession:
        return pb::Refusal::UNKNOWN_SESSION;
      default:
        return pb::Refusal::INVALID;
    }
  }();
  note(PeerLine::kChunkRefused, {{"conn", id_},
                                 {"station", who_.name},
                                 {"session", sessionText(chunk.session_id())},
                                 {"seq", chunk.seq()},
                                 {"reason", reasonName(reason)},
                                 {"expected_seq", appended.next_seq}});
  if (over()) return;
  pb::Refusal refusal = sessionRefusal(reason, appended.text, chunk.session_id(), appended.next_seq);
  // two recordings with the same session id: nothing that follows can be stored; SessionStore::append has
  // written an audit line
  if (contradicts)
    refuseAndClose(std::move(refusal));
  else
    refuse(std::move(refusal));
}

void PeerConnection::scheduleAcks() {
  // the chunks of one commit arrive together and get one acknowledgement
  if (std::exchange(acks_scheduled_, true)) return;
  asio::post(context_.io, [self = shared_from_this()] {
    self->acks_scheduled_ = false;
    self->sendAcks();
  });
}

void PeerConnection::sendAcks() {
  for (auto& [session_id, marks] : sessions_) {
    if (!std::exchange(marks.ack_due, false)) continue;
    pb::Envelope envelope;
    envelope.mutable_ack()->set_session_id(session_id);
    envelope.mutable_ack()->set_committed_seqs(marks.committed);
    envelope.mutable_ack()->set_safe_seqs(marks.safe);
    ++context_.counters.acks;
    sendControl(envelope);
  }
}

void PeerConnection::sendSafe() {
  asio::co_spawn(context_.io, safeOf(shared_from_this()), endOnException(shared_from_this()));
}

Task<> PeerConnection::safeOf(std::shared_ptr<PeerConnection> self) {
  PeerConnection& peer = *self;
  std::vector<std::string> ids;
  for (const auto& [session_id, marks] : peer.sessions_) ids.push_back(session_id);
  using Safe = std::map<std::string, std::uint64_t>;
  std::function<Result<Safe>()> read = [&store = peer.context_.store, ids]() -> Result<Safe> {
    ASSIGN_OR_RETURN(auto reader, store.readers().borrow());
    Safe safe;
    for (const std::string& session_id : ids) {
      ASSIGN_OR_RETURN(auto seqs, SessionStore(*reader).safeSeqs(*sessionIdOf(session_id)));
      safe[session_id] = seqs;
    }
    return safe;
  };
  auto safe = co_await offload(peer.context_.work.workers, std::move(read));
  if (!safe.ok()) {
    logEvent(LogLevel::kError, "read_failed", {{"conn", peer.id_}, {"text", safe.error().message}});
    co_return;
  }
  for (const auto& [session_id, seqs] : *safe) {
    const auto found = peer.sessions_.find(session_id);
    if (found == peer.sessions_.end() || seqs <= found->second.safe) continue;
    found->second.safe = seqs;
    found->second.ack_due = true;
  }
  peer.sendAcks();
}

}  // namespace needlelab
