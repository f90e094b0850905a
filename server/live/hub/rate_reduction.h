/// Live frames at a lower rate than the station's.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "common/gesture/sample.h"
#include "common/wire/live_frames.h"

namespace needlelab {

/// The rates to which frames are reduced, in Hz, ascending. A frame is reduced at most once for each of them,
/// regardless of the rates viewers request.
inline constexpr std::array kReducedRates_hz = {0.1,  0.2,  0.5,   1.0,   2.0,   5.0,    10.0,   25.0,
                                                30.0, 60.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0};

/// The greatest of these rates that is at most `asked_hz` (> 0), or the lowest if there is none.
double reducedRateOf(double asked_hz);

/// Reduces the sample rate: keeps the first sample at or after each point of a time grid at the wanted rate.
/// Uses the station's own times, so the result does not depend on the loop's rate. Thread: one.
class RateReducer {
 public:
  /// rate_hz > 0
  explicit RateReducer(double rate_hz);

  /// Returns the samples to forward; often none.
  std::vector<GestureSample> keep(std::span<const GestureSample> samples);

 private:
  std::int64_t period_ns_;
  std::int64_t due_ns_ = 0;
  std::int64_t last_ns_ = 0;
  bool started_ = false;
};

/// The samples of a received live frame, decoded once, on first use.
class LiveSamples {
 public:
  /// `data` must outlive this.
  explicit LiveSamples(std::string_view data) : data_(data) {}

  /// Empty if the bytes are not a chunk.
  std::span<const GestureSample> all();
  /// As declared by the station. Call only if all() is not empty.
  [[nodiscard]] const Resolution& resolution() const { return resolution_; }
  [[nodiscard]] bool decoded() const { return decoded_; }

 private:
  std::string_view data_;
  std::vector<GestureSample> samples_;
  Resolution resolution_;
  bool decoded_ = false;
};

/// A station's frames at one lower rate (of kReducedRates_hz). All its viewers at that rate get the same
/// frames, numbered separately from the station's. Thread: one.
class ReducedFrames {
 public:
  /// rate_hz > 0
  explicit ReducedFrames(double rate_hz) : reducer_(rate_hz) {}

  /// The frame to send for the station's next one; null if no sample is on the grid. `station`: its name.
  Frame next(const LiveFrameView& frame, LiveSamples& samples, std::string_view station);
  /// For a frame already reduced to this rate: only changes its number.
  Frame asItIs(const LiveFrameView& frame, std::string_view station);
  /// Call when the numbering changes: no gap is derived from the next frame's number.
  void otherNumbers() { last_of_station_.reset(); }

 private:
  void keepGap(std::uint64_t frame_seq);
  RateReducer reducer_;
  std::uint64_t number_ = 0;  // of the next frame; keeps the gaps of the station's numbers
  std::optional<std::uint64_t> last_of_station_;
};

}  // namespace needlelab
