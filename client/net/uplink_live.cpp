// The live plane: frames while somebody watches, status lines, clock probes; on the uplink's own thread.
#include <cmath>
#include <utility>

#include "client/net/uplink.h"
#include "common/base/clock.h"

namespace needlelab {
namespace {

constexpr std::size_t kMostHazardBytes = 400;  // of all names together, beside 1 KiB of trouble

/// Servers refuse long status lines (server/live/hub.h): the beginning of the text, not through a character.
void cutText(std::string& text, std::size_t bytes) {
  if (text.size() <= bytes) return;
  while (bytes > 0 && (static_cast<unsigned char>(text[bytes]) & 0xc0) == 0x80) --bytes;
  text.resize(bytes);
}

}  // namespace

void Uplink::pumpLive() {
  if (!channel_ || channel_->closing() || current_ == nullptr) return;
  std::deque<Live> live;
  {
    const std::scoped_lock lock(mutex_);
    live.swap(live_);
    frame_seq_ += live_skipped_;  // the gap shows
    live_skipped_ = 0;
    state_.live_frames += live.size();
  }
  for (const Live& item : live) {
    pb::Envelope envelope;
    pb::LiveFrame& frame = *envelope.mutable_live_frame();
    frame.set_session_id(current_->spool()->description().session_id());
    frame.set_frame_seq(frame_seq_++);
    frame.set_data(item.piece.chunk->data(), item.piece.chunk->size());
    frame.set_due_steady_ns(item.piece.last.time_ns);
    frame.set_capture_unix_ns(item.capture_unix_ns);
    if (auto encoded = encodeFrame(envelope); encoded.ok()) channel_->sendLive(*encoded, true);
  }
}

void Uplink::sendStatus() {
  pb::Envelope envelope;
  pb::StationStatus& status = *envelope.mutable_station_status();
  {
    const std::scoped_lock lock(mutex_);
    status.set_spool_left(state_.chunks_left);
    for (const auto& [source, words] : troubles_)
      status.set_trouble(status.trouble() + (status.trouble().empty() ? "" : "; ") + words);
    cutText(*status.mutable_trouble(), 1024);
    if (current_ != nullptr && newest_) {
      const GestureSample& last = newest_->last;
      status.set_phase(last.phase);
      status.set_layer(last.layer);
      status.set_insertion_m(last.insertion_m);
      status.set_force_n(std::hypot(last.force_W_N[0], last.force_W_N[1], last.force_W_N[2]));
      status.set_samples(newest_->samples_so_far);
      status.set_fault(last.fault);
      status.set_warnings(std::exchange(flags_since_status_, 0));
    }
    status.set_peak_force_n(facts_.peak_force_N);
    status.set_force_limit_n(facts_.force_limit_N);
    status.set_tissue(facts_.tissue);
    cutText(*status.mutable_tissue(), 64);
    std::size_t room = kMostHazardBytes;
    for (const std::string& name : facts_.hazards_touched) {
      if (name.size() + 3 > room) break;
      room -= name.size() + 3;  // with its tag and length
      status.add_hazards_touched(name);
    }
    status.set_live_dropped(state_.live_dropped - dropped_before_);
  }
  if (current_ != nullptr && !current_->spool()->contents().ended) {
    const pb::SessionDescription& description = current_->spool()->description();
    status.set_session_id(description.session_id());
    status.set_trainee(description.trainee());
    status.set_exercise_id(description.exercise_id());
    status.set_started_unix_ns(description.started_unix_ns());
  }
  status.set_missed_ticks(missed_ticks_.load(std::memory_order_relaxed));
  status.set_wakeup_p99_us(wakeup_p99_us_.load(std::memory_order_relaxed));
  if (auto encoded = encodeFrame(envelope); encoded.ok()) channel_->sendLive(*encoded, false);
}

void Uplink::sendProbe() {
  pb::Envelope envelope;
  envelope.mutable_ping()->set_id(++probes_);
  envelope.mutable_ping()->set_sender_steady_ns(steadyNowNs());
  channel_->send(envelope);
}

void Uplink::sendClockOffset() {
  const auto& best = clock_.best();
  if (!best || current_ == nullptr || !current_->opened() || clock_sent_ns_ == best->round_trip_ns) return;
  pb::Envelope envelope;
  pb::ClockOffset& offset = *envelope.mutable_clock_offset();
  offset.set_session_id(current_->spool()->description().session_id());
  offset.set_offset_ns(best->offset_ns);
  offset.set_round_trip_ns(best->round_trip_ns);
  channel_->send(envelope);
  clock_sent_ns_ = best->round_trip_ns;
}

}  // namespace needlelab
