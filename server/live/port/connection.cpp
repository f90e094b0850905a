#include "server/live/port/connection.h"

#include <fmt/core.h>

#include <cassert>
#include <utility>

#include "common/base/time/clock.h"
#include "common/wire/protocol.h"
#include "server/base/log.h"
#include "server/live/counters.h"
#include "server/live/hub/hub.h"
#include "server/live/limits/server_limits.h"
#include "server/live/work/server_work.h"
#include "server/live/work/turn_queue.h"
#include "server/together/server_together.h"

namespace needlelab {

PeerConnection::PeerConnection(ServerContext& context, std::uint64_t id, std::shared_ptr<Channel> channel)
    : context_(context),
      id_(id),
      channel_(std::move(channel)),
      pong_(channel_->executor()),
      freed_(channel_->executor()),
      turn_name_("connection " + std::to_string(id)),
      address_key_(Admission::keyOf(peerHost())) {}

PeerConnection::~PeerConnection() = default;

std::string PeerConnection::peerHost() const {
  return address().substr(0, address().rfind(':'));
}

void PeerConnection::setState(ConnectionState next) {
  assert(mayFollow(state_, next));
  logEvent(LogLevel::kDebug, "connection_state",
           {{"conn", id_}, {"from", nameOf(state_)}, {"to", nameOf(next)}});
  state_ = next;
  if (over()) *gone_ = true;
}

void PeerConnection::checkHangUp() {
  if (!gone() && (channel_->closing() || channel_->peerHungUp())) *gone_ = true;
}

Task<> PeerConnection::run(std::shared_ptr<PeerConnection> self) {
  PeerConnection& peer = *self;
  ++peer.context_.counters.connections;
  peer.context_.connections.emplace(peer.id_, &peer);
  peer.note(PeerLine::kConnectionOpened, {{"conn", peer.id_}, {"peer", peer.address()}});

  const Status shaken = co_await peer.shakeHands();
  if (!shaken.ok()) ++peer.context_.counters.handshakes_failed;
  if (shaken.ok() && peer.state_ == ConnectionState::kConnecting) peer.setState(ConnectionState::kGreeting);
  while (!peer.over() && !peer.channel_->closing()) {
    auto cut = peer.channel_->next();
    if (cut.ok() && !cut->has_value()) {
      if (const Status more = co_await peer.channel_->readMore(); !more.ok()) break;
      continue;
    }
    // most messages are live frames: forward their bytes without parsing
    if (cut.ok() && peer.passLive(**cut)) continue;
    Status taken;
    if (cut.ok())  // not ?: around co_await, which g++ 12 miscompiles
      taken = co_await peer.take(**cut);
    else
      taken = cut.error();
    if (!taken.ok() && taken.error().message == kHttpRequestCame) {
      peer.answerHttp();
      break;
    }
    if (!taken.ok()) {
      // the bytes are not a message: the stream is unusable, but tell the peer why
      const ErrorCode code = taken.error().code;
      if (code == ErrorCode::kInvalidInput || code == ErrorCode::kCorrupt) {
        const auto reason = code == ErrorCode::kCorrupt ? pb::Refusal::INVALID : pb::Refusal::TOO_LARGE;
        peer.refuseAndClose(makeRefusal(reason, taken.error().message, true));
      }
      break;
    }
    // pending work is limited: at the limit, stop reading this socket (and no other)
    while (peer.busy() && !peer.over() && !peer.channel_->closing()) co_await peer.freed_.wait();
    // after an outage all stations send their spools at once: let them wait instead of cutting them off.
    // People send no chunks and are always read
    while (peer.who_.role == pb::STATION && peer.context_.in_flight.chunksFull() && !peer.over() &&
           !peer.channel_->closing())
      co_await peer.context_.in_flight.chunk_room.wait();
  }
  // the server is stopping: shutDown sends the last message
  while (peer.over() && !peer.channel_->closing()) co_await peer.freed_.wait();
  peer.leave();
}

void PeerConnection::answerHttp() {
  const std::string text =
      context_.web_port == 0
          ? "This is the port for stations and programs; this server has no console.\n"
          : fmt::format("This is the port for stations and programs. The console is at port {}.\n",
                        context_.web_port);
  channel_->finishWith(
      CloseReason::kProtocol, std::string(kHttpRequestCame),
      fmt::format("HTTP/1.1 421 Misdirected Request\r\nContent-Type: text/plain; charset=utf-8\r\n"
                  "Content-Length: {}\r\nConnection: close\r\n\r\n{}",
                  text.size(), text));
}

// See handshake_turns.h for the order. A connection asks for a turn when its first TLS record is complete,
// and gives it back as soon as the handshake waits for the peer.
Task<Status> PeerConnection::shakeHands() {
  if (const Status spoke = co_await channel_->peerSpoke(); !spoke.ok()) co_return spoke;
  context_.limits.handshakes.came(id_, address_key_,
                                  context_.limits.admission.knows(address_key_, steadyNowNs()));
  grantTurns(context_);
  while (!my_turn_ && !over() && !channel_->closing()) co_await freed_.wait();
  Status shaken = Error{ErrorCode::kUnavailable, "the peer gave up before its handshake began"};
  if (my_turn_ && !over() && !channel_->closing()) {
    if (channel_->peerHungUp()) {
      channel_->close(CloseReason::kPeerClosed, shaken.error().message);
    } else {
      std::function<void()> waits = [this] {
        context_.limits.handshakes.answered(id_, steadyNowNs());
        grantTurns(context_);
      };
      shaken = co_await channel_->handshake(asio::ssl::stream_base::server, std::move(waits));
    }
  }
  context_.limits.handshakes.left(id_);
  grantTurns(context_);
  co_return shaken;
}

void PeerConnection::grantTurns(ServerContext& context) {
  HandshakeTurns& turns = context.limits.handshakes;
  while (const auto id = turns.next(steadyNowNs())) {
    auto& peer = static_cast<PeerConnection&>(*context.connections.at(*id));
    peer.my_turn_ = true;
    peer.freed_.notify();
  }
  context.limits.handshakes_due.cancel();
  const auto at_ns = turns.nextAt();
  if (!at_ns) return;
  context.limits.handshakes_due.expires_at(asio::steady_timer::time_point(std::chrono::nanoseconds(*at_ns)));
  context.limits.handshakes_due.async_wait([&context](const boost::system::error_code& error) {
    if (!error) grantTurns(context);
  });
}

void PeerConnection::leave() {
  if (state_ == ConnectionState::kClosed) return;
  if (who_.role == pb::STATION) {
    context_.hub.detachStation(who_.name, *this);
    const auto newest = context_.together.newest_logins.find(who_.name);
    if (newest != context_.together.newest_logins.end() && newest->second == id_)
      context_.together.newest_logins.erase(newest);
  }
  context_.hub.detachViewer(*this);
  context_.limits.admission.left(id_);
  context_.counters.live_dropped += channel_->live().dropped();
  context_.counters.bytes_received += channel_->bytesReceived();
  context_.counters.bytes_sent += channel_->bytesSent();
  if (!channel_->closing()) channel_->close(CloseReason::kLocal, "the connection ended");
  note(PeerLine::kConnectionClosed, {{"conn", id_},
                                     {"who", who_.name},
                                     {"reason", nameOf(channel_->closeReason())},
                                     {"text", channel_->closeText()},
                                     {"bytes_in", channel_->bytesReceived()},
                                     {"bytes_out", channel_->bytesSent()},
                                     {"live_dropped", channel_->live().dropped()}});
  if (refusals_of_peer_ > 1)
    note(PeerLine::kRefusedByPeerOften, {{"conn", id_}, {"who", who_.name}, {"count", refusals_of_peer_}});
  setState(ConnectionState::kClosed);
  context_.connections.erase(id_);
  pong_.notify();
}

bool PeerConnection::busy() const {
  const ConnectionBounds& bounds = context_.limits.bounds;
  if (requests_at_work_ >= bounds.requests_at_work) return true;
  if (who_.role != pb::STATION) return false;
  return context_.in_flight.chunks.takenBy(who_.name) >= bounds.chunks_in_flight ||
         context_.in_flight.chunk_bytes.takenBy(who_.name) > bounds.chunk_bytes_in_flight;
}

void PeerConnection::refuse(pb::Refusal::Reason reason, std::string text, std::uint64_t request) {
  refuse(makeRefusal(reason, std::move(text)), request);
}

void PeerConnection::refuse(pb::Refusal refusal, std::uint64_t request) {
  ++context_.counters.messages_refused;
  if (refusal.reason() == pb::Refusal::NO_ROOM) {
    // not the peer's fault; a station retries until there is room
    ++context_.counters.refused_for_room;
    note(PeerLine::kNoRoom, {{"conn", id_}, {"who", who_.name}, {"text", refusal.text()}});
    pb::Envelope envelope;
    envelope.set_refused_request(request);
    *envelope.mutable_refusal() = std::move(refusal);
    sendControl(envelope);
    return;
  }
  note(refusal.reason() == pb::Refusal::ROLE ? PeerLine::kMessageRefusedForRole : PeerLine::kMessageRefused,
       {{"conn", id_},
        {"who", who_.name},
        {"reason", reasonName(refusal.reason())},
        {"text", refusal.text()}});
  // before log-in the first fault ends the connection; afterwards too many faults do
  const bool logged_in = who_.role != pb::ROLE_UNSPECIFIED;
  if (!logged_in || ++refusals_ > context_.limits.bounds.refusals) {
    refuseAndClose(std::move(refusal));
    return;
  }
  pb::Envelope envelope;
  envelope.set_refused_request(request);
  *envelope.mutable_refusal() = std::move(refusal);
  sendControl(envelope);
}

void PeerConnection::note(const PeerLineKind& kind, std::initializer_list<LogField> fields) {
  const bool stranger = who_.role == pb::ROLE_UNSPECIFIED;
  context_.limits.lines.write(stranger ? PeerLines::kStrangers : turnNameOf(who_), kind, steadyNowNs(),
                              fields);
}

void PeerConnection::refuseAndClose(pb::Refusal refusal) {
  if (over()) return;
  refusal.set_fatal(true);
  pb::Envelope envelope;
  const std::string text = reasonName(refusal.reason()) + ": " + refusal.text();
  *envelope.mutable_refusal() = std::move(refusal);
  setState(ConnectionState::kClosing);
  channel_->finish(CloseReason::kRefused, text, &envelope);
  freed_.notify();
}

/// A peer may send any number of refusals; they must not fill the log. Before log-in the first one ends the
/// connection, and the closing log line gives the reason. After log-in, only the first one and their final
/// number are logged.
void PeerConnection::refusedByPeer(const pb::Refusal& refusal) {
  if (who_.role == pb::ROLE_UNSPECIFIED) {
    setState(ConnectionState::kClosing);
    channel_->finish(
        CloseReason::kPeerClosed,
        "the peer refuses: " + std::string(reasonName(refusal.reason())) + ": " + refusal.text());
    freed_.notify();
    return;
  }
  if (++refusals_of_peer_ > 1) return;
  note(PeerLine::kRefusedByPeer, {{"conn", id_},
                                  {"who", who_.name},
                                  {"reason", reasonName(refusal.reason())},
                                  {"text", refusal.text()}});
}

void PeerConnection::shutDown(const std::string& reason) {
  asio::co_spawn(context_.io, shutDownOf(shared_from_this(), reason), endOnException(shared_from_this()));
}

Task<> PeerConnection::shutDownOf(std::shared_ptr<PeerConnection> self, std::string reason) {
  PeerConnection& peer = *self;
  if (peer.over()) co_return;
  // ignore all further input; the peer keeps it and sends it to the next server
  peer.setState(ConnectionState::kClosing);
  while ((peer.chunks_in_flight_ > 0 || !peer.closing_sessions_.empty()) && !peer.channel_->closing()) {
    co_await peer.freed_.wait();
  }
  peer.sendAcks();
  pb::Envelope bye;
  bye.mutable_bye()->set_reason(reason);
  peer.channel_->finish(CloseReason::kLocal, reason, &bye);
  peer.freed_.notify();
}

void PeerConnection::cut(const std::string& reason) {
  if (!over()) setState(ConnectionState::kClosing);
  channel_->close(CloseReason::kLocal, reason);
  freed_.notify();
}

std::function<void(std::exception_ptr)> PeerConnection::endOnException(std::shared_ptr<PeerConnection> self) {
  return [self = std::move(self)](std::exception_ptr error) {
    if (!error) return;
    std::string text = "an unknown fault";
    try {
      std::rethrow_exception(error);
    } catch (const std::exception& thrown) {
      text = thrown.what();
    } catch (...) {  // not from this program's libraries
    }
    logEvent(LogLevel::kError, "connection_failed",
             {{"conn", self->id_}, {"who", self->who_.name}, {"text", text}});
    if (self->state_ == ConnectionState::kClosed) return;
    self->cut("its work failed inside: " + text);
    // needed if run() itself failed; otherwise run() finds it done
    self->context_.limits.handshakes.left(self->id_);
    self->leave();
    grantTurns(self->context_);
  };
}

void PeerConnection::sendControl(const pb::Envelope& envelope) {
  sendHolding(envelope, nullptr);
}

void PeerConnection::sendHolding(const pb::Envelope& envelope, std::shared_ptr<const void> until_sent) {
  if (!channel_->closing() && !channel_->send(envelope, std::move(until_sent))) {
    note(PeerLine::kSlowPeer, {{"conn", id_}, {"who", who_.name}, {"text", channel_->closeText()}});
    freed_.notify();
  }
}

void PeerConnection::sendLive(Frame frame, bool counted) {
  channel_->sendLive(std::move(frame), counted);
}

}  // namespace needlelab
