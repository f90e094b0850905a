#include "tests/load/load_station.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/base/clock.h"
#include "common/gesture/chunk.h"
#include "common/wire/protocol.h"

namespace needlelab::test {
namespace {

constexpr std::uint64_t kWindow = 64;
constexpr std::size_t kMostQueuedBytes = 1u << 20;
constexpr std::uint64_t kFramesPerStatus = 5;  // 10 Hz
constexpr std::chrono::milliseconds kFirstRetry{200}, kMostRetry{5000};

// one thread's work space: a thousand stations with a chunk's samples each would not fit the caches
std::span<GestureSample> scratch(std::size_t count) {
  thread_local std::vector<GestureSample> samples(LoadShared::kChunkTicks);
  return std::span(samples).first(count);
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
      backoff_(shared.seed * 1000003 + index, {kFirstRetry, kMostRetry, 2.0}),
      retry_(io),
      session_id_(plan_.session.begin(), plan_.session.end()),
      started_unix_ns_(wallNowNs()) {}

std::int64_t LoadStation::nextDue_ns() const {
  const std::uint64_t last = std::min(next_tick_ + LoadShared::kFrameTicks, shared_.ticks) - 1;
  return plan_.start_ns.load(std::memory_order_relaxed) + static_cast<std::int64_t>(last) * kTick_ns;
}

bool LoadStation::step(std::int64_t now_ns) {
  totals_.late.add(now_ns - nextDue_ns());
  const std::uint64_t count = std::min(LoadShared::kFrameTicks, shared_.ticks - next_tick_);
  if (watched_ && connected()) {
    sendLive(next_tick_, count);
  } else if (frames_ % kFramesPerStatus == 0 && connected() && opened()) {
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
  if (auto encoded = encodeFrame(envelope); encoded.ok()) channel_->sendLive(std::move(*encoded), true);
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
  if (auto encoded = encodeFrame(envelope); encoded.ok()) channel_->sendLive(std::move(*encoded), false);
  ++totals_.status_lines;
}

void LoadStation::pump() {
  if (!connected() || state_ != State::kOpen) return;
  while (sent_ < committed_ + chunks_.size() && sent_ - committed_ < kWindow &&
         channel_->controlQueueBytes() < kMostQueuedBytes) {
    Chunk& chunk = chunks_[sent_ - committed_];
    pb::Envelope envelope;
    envelope.mutable_chunk()->set_session_id(session_id_);
    envelope.mutable_chunk()->set_seq(sent_);
    envelope.mutable_chunk()->set_data(chunk.bytes);
    if (!channel_->send(envelope)) return;
    ++sent_;
    if (std::exchange(chunk.sent, true))
      ++totals_.chunks_resent;
    else
      totals_.samples_sent += chunk.samples;
  }
  if (ended_ && may_close_ && chunks_.empty()) {
    state_ = State::kClosing;
    channel_->send(closeMessage());
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
}

}  // namespace needlelab::test
