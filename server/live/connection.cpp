#include "server/live/connection.h"

#include <fmt/core.h>
#include <algorithm>
#include <cassert>
#include <utility>

#include "common/base/clock.h"
#include "common/base/secret.h"
#include "common/wire/protocol.h"
#include "db/service/requests.h"
#include "server/base/log.h"
#include "server/live/request_effects.h"

namespace needlelab {
PeerConnection::PeerConnection(ServerContext& context, std::uint64_t id, std::shared_ptr<Channel> channel)
    : context_(context),
      id_(id),
      channel_(std::move(channel)),
      pong_(channel_->executor()),
      freed_(channel_->executor()),
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
}

Task<> PeerConnection::run(std::shared_ptr<PeerConnection> self) {
  PeerConnection& peer = *self;
  ++peer.context_.counters.connections;
  peer.context_.connections.emplace(peer.id_, &peer);
  logEvent(LogLevel::kInfo, "connection_opened", {{"conn", peer.id_}, {"peer", peer.address()}});

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
    // after an outage all stations send their spools at once: make them wait, do not cut them off
    while (peer.context_.chunks_in_flight.full() && !peer.over() && !peer.channel_->closing())
      co_await peer.context_.chunk_room.wait();
  }
  // the server is stopping: shutDown sends the last message
  while (peer.over() && !peer.channel_->closing()) co_await peer.freed_.wait();
  peer.leave();
}

// The order is that of handshake_turns.h. A connection asks for a turn when its first TLS record has arrived
// completely, and gives it back as soon as the handshake waits for the peer.
Task<Status> PeerConnection::shakeHands() {
  if (const Status spoke = co_await channel_->peerSpoke(); !spoke.ok()) co_return spoke;
  context_.handshakes.came(id_, address_key_, context_.admission.knows(address_key_, steadyNowNs()));
  giveTurns(context_);
  while (!my_turn_ && !over() && !channel_->closing()) co_await freed_.wait();
  Status shaken = Error{ErrorCode::kUnavailable, "the peer gave up before its handshake began"};
  if (my_turn_ && !over() && !channel_->closing()) {
    if (channel_->peerHungUp()) {
      channel_->close(CloseReason::kPeerClosed, shaken.error().message);
    } else {
      std::function<void()> waits = [this] {
        context_.handshakes.answered(id_, steadyNowNs());
        giveTurns(context_);
      };
      shaken = co_await channel_->handshake(asio::ssl::stream_base::server, std::move(waits));
    }
  }
  context_.handshakes.left(id_);
  giveTurns(context_);
  co_return shaken;
}

void PeerConnection::giveTurns(ServerContext& context) {
  HandshakeTurns& turns = context.handshakes;
  while (const auto id = turns.next(steadyNowNs())) {
    PeerConnection& peer = *context.connections.at(*id);
    peer.my_turn_ = true;
    peer.freed_.notify();
  }
  context.handshakes_due.cancel();
  const auto at_ns = turns.nextAt();
  if (!at_ns) return;
  context.handshakes_due.expires_at(asio::steady_timer::time_point(std::chrono::nanoseconds(*at_ns)));
  context.handshakes_due.async_wait([&context](const boost::system::error_code& error) {
    if (!error) giveTurns(context);
  });
}

void PeerConnection::leave() {
  if (state_ == ConnectionState::kClosed) return;
  if (who_.role == pb::STATION) context_.hub.detachStation(who_.name, *this);
  context_.hub.detachViewer(*this);
  context_.admission.left(id_);
  context_.counters.live_dropped += channel_->live().dropped();
  context_.counters.bytes_received += channel_->bytesReceived();
  context_.counters.bytes_sent += channel_->bytesSent();
  if (!channel_->closing()) channel_->close(CloseReason::kLocal, "the connection ended");
  logEvent(LogLevel::kInfo, "connection_closed",
           {{"conn", id_},
            {"who", who_.name},
            {"reason", nameOf(channel_->closeReason())},
            {"text", channel_->closeText()},
            {"bytes_in", channel_->bytesReceived()},
            {"bytes_out", channel_->bytesSent()},
            {"live_dropped", channel_->live().dropped()}});
  if (refusals_of_peer_ > 1)
    logEvent(LogLevel::kWarning, "refused_by_peer_often",
             {{"conn", id_}, {"who", who_.name}, {"count", refusals_of_peer_}});
  setState(ConnectionState::kClosed);
  context_.connections.erase(id_);
  pong_.notify();
}

bool PeerConnection::busy() const {
  const ConnectionBounds& bounds = context_.bounds;
  return chunks_in_flight_ >= bounds.chunks_in_flight ||
         chunk_bytes_in_flight_ > bounds.chunk_bytes_in_flight ||
         requests_at_work_ + closing_sessions_.size() >= bounds.requests_at_work;
}

/// False: the message is not a plain live frame allowed now; take() checks it and reports any fault.
bool PeerConnection::passLive(ByteView bytes) {
  if (checkMessage(pb::Envelope::kLiveFrame, state_, who_.role) != Verdict::kAllowed) return false;
  const auto frame = viewLiveFrame(bytes);
  if (!frame || tooOften(pb::Envelope::kLiveFrame)) return false;
  if (auto refusal = context_.hub.onLiveFrame(*this, *frame, steadyNowNs())) refuse(std::move(*refusal));
  return true;
}

/// A message, from its bytes: checked by its first tags, counted, parsed, done. Error: the bytes are not an
/// Envelope. `frame` stays valid: nothing is read from this socket meanwhile.
Task<Status> PeerConnection::take(ByteView frame) {
  const auto head = scanEnvelope(frame);
  if (!head.ok()) co_return head.error();
  if (!mayRead(*head)) co_return Status{};
  const auto cost = measurePayload(*head);
  if (!cost.ok()) {
    if (cost.error().code == ErrorCode::kCorrupt) co_return cost.error();
    ++context_.counters.messages_refused_unparsed;
    refuse(pb::Refusal::TOO_LARGE, cost.error().message, head->request_id);
    co_return Status{};
  }
  std::optional<DecodedBudget::Share> share;
  // chunks have limits of their own (busy); before log-in a message is small, and done at once
  if (head->body != pb::Envelope::kChunk && who_.role != pb::ROLE_UNSPECIFIED &&
      cost->decoded_bytes > context_.bounds.uncounted_decoded_bytes) {
    share = co_await shareOfBudget(cost->decoded_bytes, head->request_id);
    if (!share) co_return Status{};
  }
  auto envelope = co_await parse(frame, *cost);
  if (!envelope.ok()) co_return envelope.error();
  // what is done is what was checked
  if (envelope->body_case() != head->body || envelope->request().call_case() != head->call)
    co_return Error{ErrorCode::kCorrupt, "a message that is another one than it seems"};
  if (over() || channel_->closing()) co_return Status{};
  co_await dispatch(std::move(*envelope), std::move(share));
  co_return Status{};
}

/// Whether this message is allowed now, and from this peer; false: it is refused, or of no interest. Nothing
/// of it has been parsed.
bool PeerConnection::mayRead(const EnvelopeHead& head) {
  const auto text = [&](const char* what) {
    const auto* field = pb::Envelope::descriptor()->FindFieldByNumber(static_cast<int>(head.body));
    return "'" + (field != nullptr ? field->name() : "unknown") + "' " + what + " (state " + nameOf(state_) +
           ")";
  };
  const auto refuseUnparsed = [&](pb::Refusal refusal) {
    ++context_.counters.messages_refused_unparsed;
    refuse(std::move(refusal), head.request_id);
    return false;
  };
  if (!over() && tooOften(head.body)) {
    pb::Refusal refusal = makeRefusal(pb::Refusal::RATE_LIMITED, text("comes too often"));
    // so that the station can match the refusal to its request
    refusal.set_session_id(std::string(head.session_id));
    return refuseUnparsed(std::move(refusal));
  }
  switch (checkMessage(head.body, state_, who_.role)) {
    case Verdict::kAllowed:
      break;
    case Verdict::kIgnored:
      return head.body == pb::Envelope::kPong;
    case Verdict::kUnknown:
      return refuseUnparsed(makeRefusal(pb::Refusal::INVALID, "a message without a body that protocol " +
                                                                  versionText(ourVersion()) + " knows"));
    case Verdict::kWrongState:
      return refuseUnparsed(makeRefusal(pb::Refusal::STATE, text("is not legal now")));
    case Verdict::kWrongRole:
      return refuseUnparsed(makeRefusal(pb::Refusal::ROLE, text("is not for your role")));
    case Verdict::kNeverFromPeer:
      return refuseUnparsed(makeRefusal(pb::Refusal::STATE, text("is sent by servers only")));
  }
  if (head.body == pb::Envelope::kRequest) {
    if (const Status role = checkRole(who_, head.call); !role.ok())
      return refuseUnparsed(refusalOf(role.error()));
  }
  return true;
}

/// Waits until the message fits beside those that are not done yet; meanwhile this socket is not read.
/// Nothing: it is refused, or the connection ends.
Task<std::optional<DecodedBudget::Share>> PeerConnection::shareOfBudget(std::size_t bytes,
                                                                        std::uint64_t request) {
  const auto room = context_.decoded_room;
  const BudgetOwner owner = budgetOwner(who_, fmt::format("live {}", id_));
  if (!context_.decoded.mayFit(bytes)) {
    ++context_.counters.messages_refused_unparsed;
    refuse(pb::Refusal::TOO_LARGE,
           fmt::format("the message would take some {} bytes of memory, at most {} are allowed: send less at "
                       "once",
                       bytes, context_.decoded.mostBytes()),
           request);
    co_return std::nullopt;
  }
  while (!over() && !channel_->closing()) {
    if (auto share = context_.decoded.take(owner, bytes)) co_return std::move(share);
    co_await room->wait();
  }
  co_return std::nullopt;
}

Task<Result<pb::Envelope>> PeerConnection::parse(ByteView frame, const PayloadCost& cost) {
  ++context_.counters.messages_parsed;
  context_.counters.decoded_bytes += cost.decoded_bytes;
  if (cost.parsed_bytes <= context_.bounds.parsed_here_bytes) co_return decodeFrame(frame);
  ++context_.counters.messages_parsed_elsewhere;
  std::function<Result<pb::Envelope>()> work = [frame] { return decodeFrame(frame); };
  co_return co_await offload(context_.parsers, std::move(work));
}

Task<> PeerConnection::dispatch(pb::Envelope envelope, std::optional<DecodedBudget::Share> share) {
  switch (envelope.body_case()) {
    case pb::Envelope::kHello:
      greet(envelope.hello());
      break;
    case pb::Envelope::kLogin:
      co_await logIn(std::move(*envelope.mutable_login()));
      break;
    case pb::Envelope::kPing:
      answerPing(envelope.ping());
      break;
    case pb::Envelope::kPong:
      // only confirms that the peer has read all earlier messages
      if (envelope.pong().id() <= pings_asked_) {
        pings_answered_ = std::max(pings_answered_, envelope.pong().id());
        pong_.notify();
      }
      break;
    case pb::Envelope::kOpenSession:
      co_await openSession(std::move(*envelope.mutable_open_session()));
      break;
    case pb::Envelope::kChunk:
      takeChunk(std::move(*envelope.mutable_chunk()));
      break;
    case pb::Envelope::kClockOffset:
      takeClockOffset(envelope.clock_offset());
      break;
    case pb::Envelope::kStationStatus: {
      auto refusal = context_.hub.onStatus(who_.name, envelope.station_status(), steadyNowNs());
      if (refusal) refuse(std::move(*refusal));
      break;
    }
    case pb::Envelope::kLiveFrame: {
      auto refusal = context_.hub.onLiveFrame(who_.name, envelope.live_frame(), steadyNowNs());
      if (refusal) refuse(std::move(*refusal));
      break;
    }
    case pb::Envelope::kCloseSession:
      asio::co_spawn(context_.io,
                     closeSession(shared_from_this(), std::move(*envelope.mutable_close_session())),
                     endsAlone(shared_from_this()));
      break;
    case pb::Envelope::kRequest:
      asio::co_spawn(context_.io,
                     execute(shared_from_this(), std::move(*envelope.mutable_request()), std::move(share)),
                     endsAlone(shared_from_this()));
      break;
    case pb::Envelope::kSubscribe: {
      const pb::Subscribe& wanted = envelope.subscribe();
      auto refusal = context_.hub.subscribe(*this, wanted, steadyNowNs());
      if (refusal)
        refuse(std::move(*refusal));
      else
        context_.store.service().noteWatching(who_, wanted.station(), wanted.session_id());
      break;
    }
    case pb::Envelope::kUnsubscribe: {
      auto refusal = context_.hub.unsubscribe(*this, envelope.unsubscribe().subscription());
      if (refusal) refuse(std::move(*refusal));
      break;
    }
    case pb::Envelope::kRefusal:
      refusedByPeer(envelope.refusal());
      break;
    case pb::Envelope::kBye:
      setState(ConnectionState::kClosing);
      channel_->finish(CloseReason::kPeerClosed, "the peer said bye: " + envelope.bye().reason());
      break;
    default:
      break;  // mayRead permits no other body
  }
}

bool PeerConnection::tooOften(pb::Envelope::BodyCase body) {
  // limited by pending work instead: busy()
  if (body == pb::Envelope::kChunk || body == pb::Envelope::kRequest || body == pb::Envelope::kCloseSession)
    return false;
  const std::int64_t now = steadyNowNs();
  const double leaked =
      context_.bounds.small_messages_per_s * 1e-9 * static_cast<double>(now - small_messages_at_ns_);
  small_messages_ = std::max(0.0, small_messages_ - leaked) + 1;
  small_messages_at_ns_ = now;
  return small_messages_ > context_.bounds.small_messages_at_once;
}

void PeerConnection::refuse(pb::Refusal::Reason reason, std::string text, std::uint64_t request) {
  refuse(makeRefusal(reason, std::move(text)), request);
}

void PeerConnection::refuse(pb::Refusal refusal, std::uint64_t request) {
  ++context_.counters.messages_refused;
  if (refusal.reason() == pb::Refusal::NO_ROOM) {
    // no fault of the peer's; a station asks again until there is room, and the log is on the same disk
    ++context_.counters.refused_for_room;
    if (!std::exchange(told_no_room_, true))
      logEvent(LogLevel::kWarning, "no_room", {{"conn", id_}, {"who", who_.name}, {"text", refusal.text()}});
    pb::Envelope envelope;
    envelope.set_refused_request(request);
    *envelope.mutable_refusal() = std::move(refusal);
    sendControl(envelope);
    return;
  }
  logEvent(LogLevel::kWarning, "message_refused",
           {{"conn", id_},
            {"who", who_.name},
            {"reason", reasonName(refusal.reason())},
            {"text", refusal.text()}});
  // before log-in the first fault ends the connection; after it, too many faults do
  const bool logged_in = who_.role != pb::ROLE_UNSPECIFIED;
  if (!logged_in || ++refusals_ > context_.bounds.refusals) {
    refuseAndClose(std::move(refusal));
    return;
  }
  pb::Envelope envelope;
  envelope.set_refused_request(request);
  *envelope.mutable_refusal() = std::move(refusal);
  sendControl(envelope);
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
/// connection, and its closing line in the log gives the reason. After log-in, logs the first one, and their
/// number at the end.
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
  logEvent(LogLevel::kWarning, "refused_by_peer",
           {{"conn", id_},
            {"who", who_.name},
            {"reason", reasonName(refusal.reason())},
            {"text", refusal.text()}});
}

Task<> PeerConnection::shutDown(std::shared_ptr<PeerConnection> self, std::string reason) {
  PeerConnection& peer = *self;
  if (peer.over()) co_return;
  // ignore all further input; the peer keeps it and sends it again to the next server
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

std::function<void(std::exception_ptr)> PeerConnection::endsAlone(std::shared_ptr<PeerConnection> self) {
  return [self = std::move(self)](std::exception_ptr error) {
    if (!error) return;
    std::string text = "an unknown fault";
    try {
      std::rethrow_exception(error);
    } catch (const std::exception& thrown) {
      text = thrown.what();
    } catch (...) {  // not of this program's libraries
    }
    logEvent(LogLevel::kError, "connection_failed",
             {{"conn", self->id_}, {"who", self->who_.name}, {"text", text}});
    if (self->state_ == ConnectionState::kClosed) return;
    self->cut("its work failed inside: " + text);
    // when it was run() that failed, nobody else does this; otherwise run() finds it done
    self->context_.handshakes.left(self->id_);
    self->leave();
    giveTurns(self->context_);
  };
}

void PeerConnection::sendControl(const pb::Envelope& envelope) {
  if (!channel_->closing() && !channel_->send(envelope)) {
    logEvent(LogLevel::kWarning, "slow_peer",
             {{"conn", id_}, {"who", who_.name}, {"text", channel_->closeText()}});
    freed_.notify();
  }
}

void PeerConnection::sendLive(Frame frame, bool counted) {
  channel_->sendLive(std::move(frame), counted);
}

void PeerConnection::answerPing(const pb::Ping& ping) {
  pb::Envelope envelope;
  pb::Pong& pong = *envelope.mutable_pong();
  pong.set_id(ping.id());
  pong.set_sender_steady_ns(ping.sender_steady_ns());
  pong.set_receiver_steady_ns(steadyNowNs());
  sendControl(envelope);
}

// --- requests of people and stations: the service executes them on worker threads; this completes them

/// `share`: the request's part of the budget, until it is answered.
Task<> PeerConnection::execute(std::shared_ptr<PeerConnection> self, pb::Request request,
                               std::optional<DecodedBudget::Share> /*share*/) {
  PeerConnection& peer = *self;
  const std::shared_ptr<const pb::Request> shared = wipedWhenReleased(std::move(request));
  ++peer.requests_at_work_;
  const auto outcome = co_await executeRequest(peer.context_, peer.who_, shared);
  co_await peer.answer(*shared, std::move(*outcome));
  --peer.requests_at_work_;
  peer.freed_.notify();
}

// `request` outlives this call, because execute waits for it
Task<> PeerConnection::answer(const pb::Request& request, Outcome outcome) {
  auto refusal = co_await complete(context_, request, who_.name, outcome);
  if (refusal) {
    refuse(std::move(*refusal), request.id());
    co_return;
  }
  pb::Envelope envelope;
  *envelope.mutable_reply() = std::move(outcome.reply);
  envelope.mutable_reply()->set_id(request.id());
  // a reply that is too long is an error for the requester and must not end the connection
  if (envelope.ByteSizeLong() > kMaxFrameBytes) {
    refuse(pb::Refusal::TOO_LARGE,
           fmt::format("the reply has {} bytes, at most {} can be sent: ask for less at once",
                       envelope.ByteSizeLong(), kMaxFrameBytes),
           request.id());
  } else {
    sendControl(envelope);
    if (envelope.reply().has_new_code()) wipe(*envelope.mutable_reply()->mutable_new_code()->mutable_code());
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
