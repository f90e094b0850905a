#include "server/live/hub/rate_reduction.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <iterator>
#include <utility>

#include "common/gesture/chunk.h"

namespace needlelab {

double reducedRateOf(double asked_hz) {
  assert(asked_hz > 0);
  const auto* const above = std::upper_bound(kReducedRates_hz.begin(), kReducedRates_hz.end(), asked_hz);
  return above == kReducedRates_hz.begin() ? kReducedRates_hz.front() : *std::prev(above);
}

RateReducer::RateReducer(double rate_hz)
    : period_ns_(std::max<std::int64_t>(
          1, static_cast<std::int64_t>(std::llround(1e9 / std::max(rate_hz, 1e-3))))) {}

std::vector<GestureSample> RateReducer::keep(std::span<const GestureSample> samples) {
  std::vector<GestureSample> kept;
  for (const GestureSample& sample : samples) {
    // new session or restarted station: its clock has a different origin
    const bool jumped = started_ && sample.time_ns < last_ns_;
    if (!started_ || jumped) {
      started_ = true;
      due_ns_ = sample.time_ns;
    }
    last_ns_ = sample.time_ns;
    if (sample.time_ns < due_ns_) continue;
    kept.push_back(sample);
    // the next grid point in the future
    const auto periods = (static_cast<std::uint64_t>(sample.time_ns) - static_cast<std::uint64_t>(due_ns_)) /
                             static_cast<std::uint64_t>(period_ns_) +
                         1;
    due_ns_ = static_cast<std::int64_t>(static_cast<std::uint64_t>(due_ns_) +
                                        periods * static_cast<std::uint64_t>(period_ns_));
  }
  return kept;
}

std::span<const GestureSample> LiveSamples::all() {
  if (std::exchange(decoded_, true)) return samples_;
  const auto info = inspectChunk(viewOf(data_));
  if (!info.ok()) return samples_;
  resolution_ = info->resolution;
  if (auto samples = decodeChunk(viewOf(data_)); samples.ok()) samples_ = std::move(*samples);
  return samples_;
}

/// Keeps the gap left by frames that the station's queue dropped.
void ReducedFrames::keepGap(std::uint64_t frame_seq) {
  if (last_of_station_ && frame_seq > *last_of_station_ + 1) number_ += frame_seq - *last_of_station_ - 1;
  last_of_station_ = frame_seq;
}

Frame ReducedFrames::asItIs(const LiveFrameView& frame, std::string_view station) {
  keepGap(frame.frame_seq);
  LiveFrameView numbered = frame;
  numbered.frame_seq = number_++;
  return encodeLiveFrame(numbered, station);
}

Frame ReducedFrames::next(const LiveFrameView& frame, LiveSamples& samples, std::string_view station) {
  keepGap(frame.frame_seq);
  const auto all = samples.all();
  const auto kept = reducer_.keep(all);
  if (kept.empty()) return nullptr;
  LiveFrameView reduced = frame;
  reduced.frame_seq = number_++;
  assert(kept.size() <= all.size());
  // the rate exceeds the station's: forward its own bytes
  if (kept.size() == all.size()) return encodeLiveFrame(reduced, station);
  reduced.cut_memory = reduced.paths = {};  // only for viewers that get every sample
  const Bytes data = encodeChunk(samples.resolution(), kept);
  reduced.data = textOf(data);
  return encodeLiveFrame(reduced, station);
}

}  // namespace needlelab
