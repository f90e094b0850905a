// A connection's messages: which ones are read, what they cost, and where they go.
#include <fmt/core.h>
#include <algorithm>
#include <functional>
#include <utility>

#include "common/base/time/clock.h"
#include "common/wire/protocol.h"
#include "db/service/requests/requests.h"
#include "server/base/log.h"
#include "server/live/counters.h"
#include "server/live/hub/hub.h"
#include "server/live/limits/server_limits.h"
#include "server/live/port/connection.h"
#include "server/live/port/remote_access.h"
#include "server/live/port/request_effects.h"
#include "server/live/work/server_work.h"

namespace needlelab {

/// False: not a plain live frame that is allowed now; then take() checks it and reports any fault.
bool PeerConnection::passLive(ByteView bytes) {
  if (checkMessage(pb::Envelope::kLiveFrame, state_, who_.role) != Verdict::kAllowed) return false;
  const auto frame = viewLiveFrame(bytes);
  if (!frame || tooOften(pb::Envelope::kLiveFrame)) return false;
  if (auto refusal = context_.hub.onLiveFrame(*this, *frame, steadyNowNs())) refuse(std::move(*refusal));
  return true;
}

/// Handles a message: checks its first tags, counts, parses and dispatches it. Error: the bytes are not an
/// Envelope. `frame` stays valid, because this socket is not read meanwhile.
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
  // if replies are unread, the next request waits here and holds nothing else meanwhile
  Shares shares;
  if (head->body == pb::Envelope::kRequest) {
    shares.reply = co_await roomIn(context_.in_flight.replies, context_.in_flight.reply_room,
                                   replyRoomOf(context_, who_, head->call));
    if (!shares.reply) co_return Status{};
  }
  // a chunk's own bytes have their own limits (busy); the rest of the message does not
  const std::size_t elsewhere = head->body == pb::Envelope::kChunk ? head->payload.size() : 0;
  const std::size_t counted = cost->decoded_bytes - std::min(cost->decoded_bytes, elsewhere);
  // before log-in messages are small and handled at once
  if (who_.role != pb::ROLE_UNSPECIFIED && counted > context_.limits.bounds.uncounted_decoded_bytes) {
    shares.decoded = co_await roomForDecoded(counted, head->request_id);
    if (!shares.decoded) co_return Status{};
  }
  auto envelope = co_await parse(frame, *cost);
  if (!envelope.ok()) co_return envelope.error();
  // dispatch exactly what was checked
  if (envelope->body_case() != head->body || envelope->request().call_case() != head->call)
    co_return Error{ErrorCode::kCorrupt, "a message that parses to another one than its first bytes name"};
  if (over() || channel_->closing()) co_return Status{};
  co_await dispatch(std::move(*envelope), std::move(shares));
  co_return Status{};
}

/// Whether this message is allowed now and from this peer. If false, it is refused or ignored. Does not parse
/// the message.
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
    // lets the station match the refusal to its request
    nameSession(refusal, head.session_id);
    return refuseUnparsed(std::move(refusal));
  }
  switch (checkMessage(head.body, state_, who_.role)) {
    case Verdict::kAllowed:
      break;
    case Verdict::kIgnored:
      if (head.body != pb::Envelope::kPong) return false;
      break;
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
  if (auto refusal = tooLong(head)) return refuseUnparsed(std::move(*refusal));
  if (head.body == pb::Envelope::kRequest) {
    if (const Status role = checkRole(who_, head.call); !role.ok())
      return refuseUnparsed(refusalOf(role.error()));
  }
  return true;
}

/// Waits until the message fits beside those in progress; this socket is not read meanwhile. Nothing: it was
/// refused, or the connection is ending.
Task<std::optional<ByteBudget::Share>> PeerConnection::roomForDecoded(std::size_t bytes,
                                                                      std::uint64_t request) {
  const std::size_t most = context_.in_flight.decoded.mostBytes(budgetOwner(who_));
  if (bytes > most) {
    ++context_.counters.messages_refused_unparsed;
    refuse(pb::Refusal::TOO_LARGE,
           fmt::format("the message would take some {} bytes of memory, at most {} are allowed: send less at "
                       "once",
                       bytes, most),
           request);
    co_return std::nullopt;
  }
  co_return co_await roomIn(context_.in_flight.decoded, context_.in_flight.decoded_room, bytes);
}

/// Nothing: the connection is ending.
Task<std::optional<ByteBudget::Share>> PeerConnection::roomIn(ByteBudget& budget,
                                                              std::shared_ptr<Signal> freed,
                                                              std::size_t bytes) {
  return waitForRoom(budget, std::move(freed), who_, bytes, [this] { return over() || channel_->closing(); });
}

Task<Result<pb::Envelope>> PeerConnection::parse(ByteView frame, const PayloadCost& cost) {
  ++context_.counters.messages_parsed;
  context_.counters.decoded_bytes += cost.decoded_bytes;
  if (cost.parsed_bytes <= context_.limits.bounds.parsed_here_bytes) co_return decodeFrame(frame);
  ++context_.counters.messages_parsed_off_thread;
  std::function<Result<pb::Envelope>()> work = [frame] { return decodeFrame(frame); };
  co_return co_await offload(context_.work.parsers, std::move(work));
}

Task<> PeerConnection::dispatch(pb::Envelope envelope, Shares shares) {
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
      // confirms that the peer has read all earlier messages
      if (envelope.pong().id() <= pings_asked_) {
        pings_answered_ = std::max(pings_answered_, envelope.pong().id());
        pong_.notify();
      }
      break;
    case pb::Envelope::kOpenSession:
      co_await openSession(std::move(*envelope.mutable_open_session()));
      break;
    case pb::Envelope::kChunk:
      onChunk(std::move(*envelope.mutable_chunk()));
      break;
    case pb::Envelope::kClockOffset:
      onClockOffset(envelope.clock_offset());
      break;
    case pb::Envelope::kStationStatus: {
      auto refusal = onStationStatus(std::move(*envelope.mutable_station_status()));
      if (refusal) refuse(std::move(*refusal));
      break;
    }
    case pb::Envelope::kLiveFrame: {
      auto refusal = context_.hub.onLiveFrame(*this, viewOf(envelope.live_frame()), steadyNowNs());
      if (refusal) refuse(std::move(*refusal));
      break;
    }
    case pb::Envelope::kCloseSession:
      onCloseSession(std::move(*envelope.mutable_close_session()));
      break;
    case pb::Envelope::kRequest:
      context_.limits.admission.used(id_);
      asio::co_spawn(context_.io,
                     execute(shared_from_this(), std::move(*envelope.mutable_request()), std::move(shares)),
                     endOnException(shared_from_this()));
      break;
    case pb::Envelope::kSubscribe: {
      context_.limits.admission.used(id_);
      const pb::Subscribe& wanted = envelope.subscribe();
      auto refusal = accessUnknown(context_);
      if (!refusal) refusal = context_.hub.subscribe(*this, wanted, steadyNowNs());
      if (refusal)
        refuse(std::move(*refusal));
      else
        context_.store.service().notes().noteWatching(
            who_, wanted.station(), wanted.session_id(), [](const Error& error) {
              logEvent(LogLevel::kError, "audit_failed", {{"text", error.message}});
            });
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

/// The refusal if a small message is longer than any valid one of its kind.
std::optional<pb::Refusal> PeerConnection::tooLong(const EnvelopeHead& head) const {
  const std::size_t bytes = head.payload.size();
  switch (head.body) {
    case pb::Envelope::kStationStatus:
      return context_.hub.checkStatusBytes(bytes);
    case pb::Envelope::kClockOffset:
    case pb::Envelope::kPing:
    case pb::Envelope::kPong:
    case pb::Envelope::kSubscribe:
    case pb::Envelope::kUnsubscribe:
    case pb::Envelope::kCloseSession: {
      if (bytes <= context_.limits.bounds.small_message_bytes) return std::nullopt;
      pb::Refusal refusal = makeRefusal(
          head.body == pb::Envelope::kCloseSession ? pb::Refusal::INVALID : pb::Refusal::TOO_LARGE,
          fmt::format("{} has {} bytes, at most {} are allowed",
                      pb::Envelope::descriptor()->FindFieldByNumber(static_cast<int>(head.body))->name(),
                      bytes, context_.limits.bounds.small_message_bytes));
      nameSession(refusal, head.session_id);
      return refusal;
    }
    default:
      return std::nullopt;
  }
}

bool PeerConnection::tooOften(pb::Envelope::BodyCase body) {
  // limited by pending work instead: busy()
  if (body == pb::Envelope::kChunk || body == pb::Envelope::kRequest) return false;
  const BucketRate rate{context_.limits.bounds.small_messages_at_once,
                        context_.limits.bounds.small_messages_per_s};
  return !context_.limits.small_messages.take(turn_name_, rate, 1, steadyNowNs());
}

void PeerConnection::answerPing(const pb::Ping& ping) {
  pb::Envelope envelope;
  pb::Pong& pong = *envelope.mutable_pong();
  pong.set_id(ping.id());
  pong.set_sender_steady_ns(ping.sender_steady_ns());
  pong.set_receiver_steady_ns(steadyNowNs());
  sendControl(envelope);
}

}  // namespace needlelab
