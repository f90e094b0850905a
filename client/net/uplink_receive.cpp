// What the server's messages mean; on the uplink's own thread.
#include "client/net/uplink.h"
#include "client/net/uplink_call.h"
#include "common/base/clock.h"
#include "common/wire/protocol.h"

namespace needlelab {
namespace {

/// Without those of a newer server that we cannot show.
pb::SetAids withKnownAids(const pb::SetAids& set) {
  pb::SetAids known = set;
  known.clear_aids();
  for (const int aid : set.aids()) {
    if (aid != pb::Exercise::AID_UNSPECIFIED && pb::Exercise::Aid_IsValid(aid))
      known.add_aids(static_cast<pb::Exercise::Aid>(aid));
  }
  return known;
}

}  // namespace

bool Uplink::meansCurrent(const std::string& session_id) const {
  if (session_id.empty() ||
      (current_ != nullptr && current_->spool()->description().session_id() == session_id))
    return true;
  say("an instructor's word for another lesson than this one came too late and is passed over");
  return false;
}

UplinkSession* Uplink::find(const std::string& session_id) {
  for (const auto& session : sessions_)
    if (session->spool()->description().session_id() == session_id) return session.get();
  return nullptr;
}

void Uplink::handle(const pb::Envelope& envelope) {
  switch (envelope.body_case()) {
    case pb::Envelope::kAck:
      if (events_.acknowledged) events_.acknowledged(envelope.ack());
      if (auto* session = find(envelope.ack().session_id())) session->onAck(envelope.ack());
      break;
    case pb::Envelope::kSessionOpened:
      if (auto* session = find(envelope.session_opened().session_id())) {
        const bool was_closed = session->closed();
        session->onOpened(envelope.session_opened().next_seq());
        if (was_closed && !session->closed()) sayItIsSentAgain(*session);
        if (session->refused()) say("session " + session->spool()->idText() + ": " + session->trouble());
        if (session == current_) clock_sent_ns_ = 0;
        sendClockOffset();
      }
      break;
    case pb::Envelope::kSessionClosed:
      if (events_.closed) events_.closed(envelope.session_closed());
      if (auto* session = find(envelope.session_closed().session_id())) {
        const bool was_closed = session->closed();
        session->onClosed(envelope.session_closed());
        if (session != current_ && !was_closed)
          say("session " + session->spool()->idText() + " of an earlier run is now in the server's database");
      }
      break;
    case pb::Envelope::kRefusal:
      handleRefusal(envelope);
      break;
    case pb::Envelope::kReply: {
      const std::scoped_lock lock(mutex_);
      if (call_ && call_->sent_as == envelope.reply().id()) {
        call_->result = envelope.reply();
        changed_.notify_all();
      }
      break;
    }
    case pb::Envelope::kPing:
      channel_->send(pongTo(envelope.ping()));
      break;
    case pb::Envelope::kPong:
      if (clock_.add(envelope.pong().sender_steady_ns(), envelope.pong().receiver_steady_ns(), steadyNowNs()))
        sendClockOffset();
      break;
    case pb::Envelope::kWatchState:
      watched_.store(envelope.watch_state().watched(), std::memory_order_relaxed);
      break;
    case pb::Envelope::kTraineeMessage:
      if (events_.trainee_message) events_.trainee_message(envelope.trainee_message());
      break;
    case pb::Envelope::kNextExercise:
      if (events_.next_exercise) events_.next_exercise(envelope.next_exercise());
      break;
    case pb::Envelope::kSetAids:
      if (meansCurrent(envelope.set_aids().session_id()) && events_.set_aids)
        events_.set_aids(withKnownAids(envelope.set_aids()));
      break;
    case pb::Envelope::kStopLesson:
      if (meansCurrent(envelope.stop_lesson().session_id()) && events_.stop_lesson)
        events_.stop_lesson(envelope.stop_lesson());
      break;
    case pb::Envelope::kBye:
      channel_->finish(CloseReason::kPeerClosed, "the server says goodbye: " + envelope.bye().reason());
      break;
    default:
      break;  // a newer server's message that we do not know
  }
}

void Uplink::handleRefusal(const pb::Envelope& envelope) {
  const pb::Refusal& refusal = envelope.refusal();
  if (envelope.refused_request() != 0) {
    const std::scoped_lock lock(mutex_);
    if (call_ && call_->sent_as == envelope.refused_request()) {
      call_->result = errorOf(refusal);
      changed_.notify_all();
    }
    return;
  }
  if (auto* session = refusal.session_id().empty() ? nullptr : find(refusal.session_id())) {
    session->onRefusal(refusal);
    if (session->refused()) say("session " + session->spool()->idText() + ": " + session->trouble());
    return;
  }
  say("the server refuses (" + reasonName(refusal.reason()) + "): " + refusal.text());
}

}  // namespace needlelab
