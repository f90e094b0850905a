#include "tests/load/load_station.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "client/net/uplink/uplink.h"
#include "common/base/program.h"
#include "common/base/time/clock.h"
#include "common/gesture/chunk.h"
#include "common/gesture/sample.h"
#include "common/wire/protocol.h"

namespace needlelab::test {
namespace {

constexpr std::uint64_t kWindow = 64;
constexpr std::size_t kMaxQueuedBytes = 1u << 20;
constexpr std::uint64_t kFramesPerStatus = 5;  // 10 Hz

// one buffer per thread: a chunk's samples for each of a thousand stations would not fit in the caches
std::span<GestureSample> scratch(std::size_t count) {
  thread_local std::vector<GestureSample> samples(LoadShared::kChunkTicks);
  return std::span(samples).first(count);
}

LinkSettings linkOf(const LoadShared& shared, std::size_t index) {
  LinkSettings settings = shared.link;
  settings.seed = shared.seed * 1000003 + index;
  return settings;
}

}  // namespace

void StationTotals::add(const StationTotals& other) {
  late.add(other.late);
  ack.add(other.ack);
  samples_sent += other.samples_sent;
  samples_acked += other.samples_acked;
  chunks_resent += other.chunks_resent;
  chunk_bytes += other.chunk_bytes;
  live_frames += other.live_frames;
  status_lines += other.status_lines;
  connections += other.connections;
  unsent_peak = std::max(unsent_peak, other.unsent_peak);
}

LoadStation::LoadStation(LoadShared& shared, std::size_t index, StationTotals& totals, asio::io_context& io)
    : shared_(shared),
      plan_(shared.stations[index]),
      totals_(totals),
      stream_(*shared.pool, shared.seed, index),
      link_(io, linkOf(shared, index), handlers()),
      session_id_(plan_.session.begin(), plan_.session.end()),
      started_unix_ns_(wallNowNs()) {}

std::int64_t LoadStation::nextDue_ns() const {
  const std::uint64_t last = std::min(next_tick_ + LoadShared::kFrameTicks, shared_.ticks) - 1;
  return plan_.start_ns.load(std::memory_order_relaxed) + static_cast<std::int64_t>(last) * kTick_ns;
}

bool LoadStation::step(std::int64_t now_ns) {
  totals_.late.add(now_ns - nextDue_ns());
  const std::uint64_t count = std::min(LoadShared::kFrameTicks, shared_.ticks - next_tick_);
  if (watched_ && link_.online()) {
    sendLive(next_tick_, count);
  } else if (frames_ % kFramesPerStatus == 0 && link_.online() && opened()) {
    sendStatus();
  }
  ++frames_;
  next_tick_ += count;
  if (next_tick_ - chunk_tick_ >= LoadShared::kChunkTicks) makeChunk();
  if (next_tick_ < shared_.ticks) return true;
  end();
  return false;
}

void LoadStation::end() {
  if (std::exchange(ended_, true)) return;
  if (chunk_tick_ < next_tick_) makeChunk();
  pump();
}

void LoadStation::close() {
  may_close_ = true;
  pump();
}

void LoadStation::makeChunk() {
  const std::uint64_t count = next_tick_ - chunk_tick_;
  const auto samples = scratch(count);
  stream_.fill(chunk_tick_, samples);
  const Bytes bytes = encodeChunk(Resolution::standard(), samples);
  hash_.update(bytes);
  chunk_tick_ = next_tick_;
  totals_.chunk_bytes += bytes.size();
  const std::int64_t due_ns =
      plan_.start_ns.load(std::memory_order_relaxed) + static_cast<std::int64_t>(next_tick_ - 1) * kTick_ns;
  chunks_.push_back({std::string(textOf(bytes)), count, due_ns, false});
  totals_.unsent_peak = std::max<std::uint64_t>(totals_.unsent_peak, chunks_.size());
  pump();
}

void LoadStation::sendLive(std::uint64_t first, std::uint64_t count) {
  const auto samples = scratch(count);
  stream_.fill(first, samples);
  const Bytes data = encodeChunk(Resolution::standard(), samples);
  pb::Envelope envelope;
  pb::LiveFrame& frame = *envelope.mutable_live_frame();
  frame.set_session_id(session_id_);
  frame.set_frame_seq(frame_seq_++);
  frame.set_data(data.data(), data.size());
  frame.set_due_steady_ns(samples.back().time_ns);
  frame.set_capture_unix_ns(wallNowNs() - (steadyNowNs() - nextDue_ns()));
  if (auto encoded = encodeFrame(envelope); encoded.ok()) link_.sendLive(std::move(*encoded), true);
  ++totals_.live_frames;
}

void LoadStation::sendStatus() {
  GestureSample last;
  stream_.fill(next_tick_, std::span(&last, 1));
  pb::Envelope envelope;
  pb::StationStatus& status = *envelope.mutable_station_status();
  status.set_session_id(session_id_);
  status.set_trainee("load");
  status.set_exercise_id("load");
  status.set_phase(last.phase);
  status.set_layer(last.layer);
  status.set_insertion_m(last.insertion_m);
  status.set_force_n(std::hypot(last.force_W_N[0], last.force_W_N[1], last.force_W_N[2]));
  status.set_samples(next_tick_);
  status.set_spool_left(chunks_.size());
  if (auto encoded = encodeFrame(envelope); encoded.ok()) link_.sendLive(std::move(*encoded), false);
  ++totals_.status_lines;
}

void LoadStation::pump() {
  if (!link_.online() || state_ != State::kOpen) return;
  while (sent_ < committed_ + chunks_.size() && sent_ - committed_ < kWindow &&
         link_.queuedBytes() < kMaxQueuedBytes) {
    Chunk& chunk = chunks_[sent_ - committed_];
    pb::Envelope envelope;
    envelope.mutable_chunk()->set_session_id(session_id_);
    envelope.mutable_chunk()->set_seq(sent_);
    envelope.mutable_chunk()->set_data(chunk.bytes);
    if (!link_.send(envelope)) return;
    ++sent_;
    if (std::exchange(chunk.sent, true))
      ++totals_.chunks_resent;
    else
      totals_.samples_sent += chunk.samples;
  }
  if (ended_ && may_close_ && chunks_.empty()) {
    state_ = State::kClosing;
    link_.send(closeMessage());
  }
}

void LoadStation::committed(std::uint64_t seqs) {
  const std::int64_t now_ns = steadyNowNs();
  while (committed_ < seqs && !chunks_.empty()) {
    totals_.ack.add(now_ns - chunks_.front().due_ns);
    totals_.samples_acked += chunks_.front().samples;
    samples_closed_ += chunks_.front().samples;
    chunks_.pop_front();
    ++committed_;
  }
  sent_ = std::max(sent_, committed_);
  if (opened() && committed_ >= backlog_ && whole_ns_ == 0) whole_ns_ = now_ns;
}

// --- the connection: the station's first messages, and handling of the server's answers

void LoadStation::connect() {
  ClientConfig config = shared_.clientOf(plan_.first_server);
  config.login = stationLogin(plan_.name, plan_.key);
  link_.logIn(std::move(config));
}

LinkHandlers LoadStation::handlers() {
  return {
      .accept = {},
      .connected = [this](const pb::Welcome&) { onConnected(); },
      .message =
          [this](pb::Envelope& envelope) {
            handle(envelope);
            pump();
          },
      .judge = [this](const LinkEnd& end) { return finished() ? Retry::kNever : retryOfStation(end, true); },
      .away = [this](const LinkEnd& end) { onAway(end); }};
}

void LoadStation::onConnected() {
  ++totals_.connections;
  plan_.server = shared_.numberOf(link_.server());
  state_ = State::kOpening;
  clock_ = ClockProbe{};
  link_.send(openMessage());
  pb::Envelope ping;
  ping.mutable_ping()->set_id(1);
  ping.mutable_ping()->set_sender_steady_ns(steadyNowNs());
  link_.send(ping);
}

void LoadStation::onAway(const LinkEnd& end) {
  last_error_ = end.was_connected ? end.channel_text : end.error.message;
  if (!end.was_connected) return;
  watched_ = false;
  frame_seq_ = 0;
  whole_ns_ = 0;
  if (state_ != State::kClosed) state_ = State::kNew;
  sent_ = committed_;
}

void LoadStation::handle(const pb::Envelope& envelope) {
  switch (envelope.body_case()) {
    case pb::Envelope::kAck:
      if (envelope.ack().session_id() == session_id_) committed(envelope.ack().committed_seqs());
      break;
    case pb::Envelope::kSessionOpened: {
      const std::uint64_t next = envelope.session_opened().next_seq();
      if (next < committed_ || next > committed_ + chunks_.size()) {
        trouble_ = fmt::format("the server has {} chunks, {} were acknowledged and {} made", next, committed_,
                               committed_ + chunks_.size());
        link_.drop(CloseReason::kProtocol, trouble_);
        break;
      }
      if (state_ == State::kOpening) state_ = State::kOpen;
      if (whole_ns_ == 0) backlog_ = committed_ + chunks_.size();
      committed(next);
      sent_ = committed_;
      break;
    }
    case pb::Envelope::kSessionClosed: {
      state_ = State::kClosed;
      if (envelope.session_closed().state() != pb::SESSION_COMPLETE)
        trouble_ = "the session was closed as " + pb::SessionState_Name(envelope.session_closed().state()) +
                   ", not complete";
      link_.stop("the load ends");
      break;
    }
    case pb::Envelope::kPong:
      if (clock_.add(envelope.pong().sender_steady_ns(), envelope.pong().receiver_steady_ns(),
                     steadyNowNs()) &&
          opened()) {
        pb::Envelope offset;
        offset.mutable_clock_offset()->set_session_id(session_id_);
        offset.mutable_clock_offset()->set_offset_ns(clock_.best()->offset_ns);
        offset.mutable_clock_offset()->set_round_trip_ns(clock_.best()->round_trip_ns);
        link_.send(offset);
      }
      break;
    case pb::Envelope::kWatchState:
      watched_ = envelope.watch_state().watched();
      break;
    case pb::Envelope::kRefusal:
      onRefusal(envelope.refusal());
      break;
    default:
      break;
  }
}

void LoadStation::onRefusal(const pb::Refusal& refusal) {
  last_error_ = std::string(reasonName(refusal.reason())) + ": " + refusal.text();
  const bool contradicts = refusal.reason() == pb::Refusal::CONTRADICTION;
  if ((refusal.fatal() && !contradicts) || refusal.session_id() != session_id_) return;
  if (refusal.reason() == pb::Refusal::GAP || refusal.reason() == pb::Refusal::UNKNOWN_SESSION) {
    // ask for the session's state; the server also refuses the chunks in flight before its answer
    if (state_ != State::kOpen && state_ != State::kClosing) return;
    state_ = State::kOpening;
    link_.send(openMessage());
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
      break;  // temporary: the next connection asks again
  }
  link_.drop(CloseReason::kLocal, last_error_);
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
  d.set_engine_version("needlelab-load " + programVersion());
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
  link_.cut("cut by the load generator");
}

void LoadStation::stop() {
  link_.stop("the load is stopped");
  cut();
}

}  // namespace needlelab::test
