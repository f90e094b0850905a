// A load station's connection: what it says first, and what the server's answers mean.
#include <utility>

#include "common/base/clock.h"
#include "common/gesture/sample.h"
#include "common/wire/protocol.h"
#include "tests/load/load_station.h"

namespace needlelab::test {

Task<> LoadStation::run(std::shared_ptr<LoadStation> self) {
  LoadStation& me = *self;
  while (!me.stopping_ && !me.finished()) {
    ClientConfig config = me.shared_.client;
    config.login = stationLogin(me.plan_.name, me.plan_.key);
    auto connection = co_await connectClient(std::move(config));
    if (connection.ok()) {
      me.channel_ = connection->channel;
      me.backoff_.reset();
      ++me.totals_.connections;
      co_await me.serve();
      me.last_error_ = me.channel_->closeText();
      me.channel_.reset();
      me.watched_ = false;
      me.frame_seq_ = 0;
      if (me.state_ != State::kClosed) me.state_ = State::kNew;
      me.sent_ = me.committed_;
    } else {
      me.last_error_ = connection.error().message;
    }
    if (me.stopping_ || me.finished()) break;
    me.retry_.expires_after(me.backoff_.next());
    co_await me.retry_.async_wait(kUseTuple);
  }
}

Task<> LoadStation::serve() {
  const std::shared_ptr<Channel> channel = channel_;
  state_ = State::kOpening;
  clock_ = ClockProbe{};
  channel->send(openMessage());
  pb::Envelope ping;
  ping.mutable_ping()->set_id(1);
  ping.mutable_ping()->set_sender_steady_ns(steadyNowNs());
  channel->send(ping);
  for (;;) {
    auto envelope = co_await channel->receive();
    if (!envelope.ok()) {
      channel->finish(CloseReason::kProtocol, envelope.error().message);
      co_return;
    }
    handle(*envelope);
    pump();
  }
}

void LoadStation::handle(const pb::Envelope& envelope) {
  switch (envelope.body_case()) {
    case pb::Envelope::kAck:
      if (envelope.ack().session_id() == session_id_) committed(envelope.ack().committed_seqs());
      break;
    case pb::Envelope::kSessionOpened: {
      const std::uint64_t next = envelope.session_opened().next_seq();
      if (next < committed_ || next > committed_ + chunks_.size()) {
        trouble_ = "the server has " + std::to_string(next) + " chunks, " + std::to_string(committed_) +
                   " were acknowledged and " + std::to_string(committed_ + chunks_.size()) + " made";
        channel_->finish(CloseReason::kProtocol, trouble_);
        break;
      }
      committed(next);
      sent_ = committed_;
      if (state_ == State::kOpening) state_ = State::kOpen;
      break;
    }
    case pb::Envelope::kSessionClosed: {
      state_ = State::kClosed;
      if (envelope.session_closed().state() != pb::SESSION_COMPLETE)
        trouble_ = "the session was closed as " + pb::SessionState_Name(envelope.session_closed().state()) +
                   ", not complete";
      pb::Envelope bye;
      bye.mutable_bye()->set_reason("the load ends");
      channel_->finish(CloseReason::kLocal, "the load ends", &bye);
      break;
    }
    case pb::Envelope::kPing:
      channel_->send(pongTo(envelope.ping()));
      break;
    case pb::Envelope::kPong:
      if (clock_.add(envelope.pong().sender_steady_ns(), envelope.pong().receiver_steady_ns(),
                     steadyNowNs()) &&
          opened()) {
        pb::Envelope offset;
        offset.mutable_clock_offset()->set_session_id(session_id_);
        offset.mutable_clock_offset()->set_offset_ns(clock_.best()->offset_ns);
        offset.mutable_clock_offset()->set_round_trip_ns(clock_.best()->round_trip_ns);
        channel_->send(offset);
      }
      break;
    case pb::Envelope::kWatchState:
      watched_ = envelope.watch_state().watched();
      break;
    case pb::Envelope::kRefusal:
      onRefusal(envelope.refusal());
      break;
    case pb::Envelope::kBye:
      channel_->finish(CloseReason::kPeerClosed, "the server says goodbye: " + envelope.bye().reason());
      break;
    default:
      break;
  }
}

void LoadStation::onRefusal(const pb::Refusal& refusal) {
  last_error_ = std::string(reasonName(refusal.reason())) + ": " + refusal.text();
  if (refusal.fatal() || refusal.session_id() != session_id_) return;
  if (refusal.reason() == pb::Refusal::GAP || refusal.reason() == pb::Refusal::UNKNOWN_SESSION) {
    // ask where it stands; chunks in flight are refused as well, before the answer comes
    if (state_ != State::kOpen && state_ != State::kClosing) return;
    state_ = State::kOpening;
    channel_->send(openMessage());
    return;
  }
  switch (refusal.reason()) {
    case pb::Refusal::CONTRADICTION:
    case pb::Refusal::INVALID:
    case pb::Refusal::ROLE:
    case pb::Refusal::TOO_LARGE:
    case pb::Refusal::CONFLICT:
    case pb::Refusal::NOT_FOUND:
      trouble_ = "the server refuses the session: " + last_error_;
      break;
    default:
      break;  // of the moment: the next connection asks again
  }
  channel_->finish(CloseReason::kLocal, last_error_);
}

pb::Envelope LoadStation::openMessage() const {
  pb::Envelope envelope;
  pb::SessionDescription& d = *envelope.mutable_open_session()->mutable_description();
  d.set_session_id(session_id_);
  d.set_station(plan_.name);
  d.set_trainee("load");
  d.set_exercise_id("load");
  d.set_profile_id(shared_.pool->profile_id);
  d.set_profile_json(shared_.pool->profile_json);
  d.set_engine_version("needlelab-load " NEEDLELAB_VERSION);
  d.set_rate_hz(1000);
  const Resolution resolution = Resolution::standard();
  d.mutable_resolution()->set_length_m(resolution.length_m);
  d.mutable_resolution()->set_quaternion(resolution.quaternion);
  d.mutable_resolution()->set_force_n(resolution.force_N);
  d.mutable_resolution()->set_torque_nm(resolution.torque_Nm);
  d.mutable_resolution()->set_time_s(resolution.time_s);
  d.mutable_resolution()->set_speed_m_s(resolution.speed_mps);
  d.set_started_unix_ns(started_unix_ns_);
  d.set_started_steady_ns(stream_.timeOf(0));
  d.set_device("load generator, simulated hand");
  const Vec3 at = stream_.placement_m();
  for (const double number : {at.x, at.y, at.z, 0.0, 0.0, 0.0, 1.0}) d.add_placement(number);
  return envelope;
}

pb::Envelope LoadStation::closeMessage() const {
  pb::Envelope envelope;
  pb::CloseSession& close = *envelope.mutable_close_session();
  const Digest hash = hash_.digest();
  close.set_session_id(session_id_);
  close.set_chunks(committed_);
  close.set_samples(samples_closed_);
  close.set_hash(hash.data(), hash.size());
  return envelope;
}

void LoadStation::cut() {
  if (channel_) channel_->close(CloseReason::kLocal, "cut by the load generator");
}

void LoadStation::stop() {
  stopping_ = true;
  retry_.cancel();
  cut();
}

}  // namespace needlelab::test
