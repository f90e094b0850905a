#include "client/instructor/model/live/live_station.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/gesture/chunk.h"

namespace needlelab {
namespace {

/// Quantile by nearest rank; 0 without values.
double quantile(std::vector<float> values, double q) {
  if (values.empty()) return 0;
  const double rank = std::ceil(std::clamp(q, 0.0, 1.0) * static_cast<double>(values.size()));
  const std::size_t index = std::clamp<std::size_t>(static_cast<std::size_t>(rank), 1, values.size()) - 1;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(index), values.end());
  return static_cast<double>(values[index]);
}

}  // namespace

void LiveStats::add(const pb::LiveFrame& frame, std::size_t samples, std::int64_t received_unix_ns) {
  // a smaller number means that the station restarted; nothing was lost
  if (last_seq_ && frame.frame_seq() > *last_seq_ + 1) dropped_ += frame.frame_seq() - *last_seq_ - 1;
  last_seq_ = frame.frame_seq();
  last_latency_ms_ = 1e-6 * static_cast<double>(received_unix_ns - frame.capture_unix_ns());
  latencies_ms_[frames_ % kKept] = static_cast<float>(last_latency_ms_);
  ++frames_;
  samples_ += samples;
}

double LiveStats::latencyMs(double q) const {
  const auto kept = static_cast<std::ptrdiff_t>(std::min<std::uint64_t>(frames_, kKept));
  return quantile({latencies_ms_.begin(), latencies_ms_.begin() + kept}, q);
}

void LatencyMeter::fed(std::int64_t capture_unix_ns) {
  // A station without a clock sends 0. The limit is needed because presented() may never be called.
  if (capture_unix_ns > 0 && waiting_.size() < 4096) waiting_.push_back(capture_unix_ns);
}

void LatencyMeter::presented(std::int64_t now_unix_ns) {
  for (const std::int64_t capture : waiting_) {
    last_ms_ = 1e-6 * static_cast<double>(now_unix_ns - capture);
    if (shown_ms_.size() < kKept)
      shown_ms_.push_back(static_cast<float>(last_ms_));
    else
      shown_ms_[shown_ % kKept] = static_cast<float>(last_ms_);
    ++shown_;
  }
  waiting_.clear();
}

void LatencyMeter::clear() {
  waiting_.clear();
  shown_ms_.clear();
  shown_ = 0;
  last_ms_ = 0;
}

double LatencyMeter::quantile_ms(double q) const {
  return quantile(shown_ms_, q);
}

LiveStation::LiveStation(std::string station) : station_(std::move(station)), trace_(kLiveSpan_s) {}

void LiveStation::beginSession(const std::string& session_id) {
  session_id_ = session_id;
  described_ = false;
  asked_s_ = -1e9;
  info_.Clear();
  scene_ = {};
  replica_.reset();
  trace_.clear();
  undescribed_.clear();
  last_frame_.reset();
  stats_.streamRestarts();
  newest_tick_ = 0;
  paused_at_s_.reset();
}

void LiveStation::feed(const LiveArrival& arrival) {
  const pb::LiveFrame& frame = arrival.frame;
  if (frame.station() != station_ || frame.session_id().empty()) return;
  if (frame.session_id() != session_id_) beginSession(frame.session_id());
  auto samples = decodeChunk(viewOf(frame.data()));
  if (!samples.ok() || samples->empty()) {
    ++unreadable_;
    return;
  }
  Received received;
  received.cuts = cutsIn(viewOf(frame.cut_memory()));
  const ByteView paths = viewOf(frame.paths());
  if (paths.size() <= kMaxPathsBytes) received.paths.assign(paths.begin(), paths.end());
  stats_.add(frame, samples->size(), arrival.received_unix_ns);
  if (described_) latency_.fed(frame.capture_unix_ns());
  if (last_frame_ && frame.frame_seq() != *last_frame_ + 1 && replica_) replica_->noteGap();
  last_frame_ = frame.frame_seq();
  newest_tick_ = samples->back().tick;
  received.samples = *std::move(samples);
  if (described_) {
    take(received);
    return;
  }
  undescribed_.push_back(std::move(received));
  if (undescribed_.size() > kFramesKept) undescribed_.pop_front();
}

void LiveStation::take(const Received& received) {
  if (replica_) replica_->takePaths(received.paths);
  for (const GestureSample& sample : received.samples)
    trace_.push(replica_ ? replica_->feed(sample) : momentOfSample(sample, rate_hz_));
  if (replica_ && received.cuts) replica_->takeCuts(*received.cuts);
}

void LiveStation::onStatus(const pb::StationStatus& status) {
  if (status.station() != station_) return;
  // a reconnected station restarts its frame numbers
  if (status.online() != status_.online()) {
    stats_.streamRestarts();
    last_frame_.reset();
    if (replica_) replica_->noteGap();
  }
  status_ = status;
}

std::string LiveStation::sessionToRequest(double now_s) {
  if (described_ || session_id_.empty() || now_s - asked_s_ < kAskAgain_s) return {};
  asked_s_ = now_s;
  return session_id_;
}

void LiveStation::setSession(const pb::SessionInfo& info, const ScenePreparer& prepare) {
  if (described_ || info.description().session_id() != session_id_) return;
  described_ = true;
  new_scene_frames_ = 0;
  info_ = info;
  const double rate_hz = info.description().rate_hz();
  rate_hz_ = rate_hz >= 50 && rate_hz <= 40'000 ? rate_hz : 1000;
  scene_ = sceneOfSession(info.description(), prepare);
  trace_ = traceOf(scene_, kLiveSpan_s);
  if (scene_.model) replica_ = std::make_unique<GestureReplica>(scene_.model, false, rate_hz_);
  for (const Received& received : undescribed_) take(received);
  undescribed_.clear();
}

void LiveStation::connectionLost() {
  stats_.streamRestarts();
  last_frame_.reset();
  if (replica_) replica_->noteGap();
}

void LiveStation::presented(std::int64_t now_unix_ns) {
  constexpr int kFirstFrames = 3;
  if (described_ && !trace_.empty() && new_scene_frames_ < kFirstFrames) {
    ++new_scene_frames_;
    latency_.discard();
    return;
  }
  latency_.presented(now_unix_ns);
}

void LiveStation::addRemark(std::uint64_t tick, const std::string& text) {
  TraceEvent event;
  event.kind = TraceEvent::Kind::kRemark;
  event.time_s = static_cast<double>(tick) / rate_hz_;
  event.text = text;
  trace_.add(std::move(event));
}

void LiveStation::pause() {
  if (!paused_at_s_) paused_at_s_ = trace_.lastTime_s();
}

void LiveStation::scrollTo(double end_s) {
  if (std::isfinite(end_s)) paused_at_s_ = std::clamp(end_s, trace_.firstTime_s(), trace_.lastTime_s());
}

void LiveStation::setSpan(double span_s) {
  if (std::isfinite(span_s)) span_s_ = std::clamp(span_s, 2.0, kLiveSpan_s);
}

double LiveStation::viewEnd_s() const {
  return paused_at_s_ ? std::max(*paused_at_s_, trace_.firstTime_s()) : trace_.lastTime_s();
}

const Moment& LiveStation::shown() const {
  return paused_at_s_ && !trace_.empty() ? trace_.at(viewEnd_s()) : trace_.last();
}

}  // namespace needlelab
