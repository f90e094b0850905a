// What the server's messages mean; on the uplink's own thread.
#include "base/clock.h"
#include "net/uplink.h"
#include "net/uplink_lesson_call.h"
#include "wire/refusal.h"

namespace needlelab {

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
      if (lesson_ && lesson_->sent_as == envelope.reply().id() && envelope.reply().has_lesson()) {
        lesson_->result = envelope.reply().lesson();
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
    if (lesson_ && lesson_->sent_as == envelope.refused_request()) {
      lesson_->result = errorOf(refusal);
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
