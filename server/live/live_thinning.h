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

/// The rates that frames are thinned to, in Hz, upwards: a frame is thinned for each of them once at most,
/// whatever its viewers ask for.
inline constexpr std::array kThinnedRates_hz = {0.1,  0.2,  0.5,   1.0,   2.0,   5.0,    10.0,   25.0,
                                                30.0, 60.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0};

/// The greatest of them that is not above `asked_hz` (above 0); the least of them for less.
double thinnedRateOf(double asked_hz);

/// Reduces the sample rate: keeps the first sample at or after each point of a time grid at the wanted rate,
/// by the station's own times, so the result does not depend on the loop's rate. Thread: one.
class Decimator {
 public:
  /// rate_hz > 0
  explicit Decimator(double rate_hz);

  /// Returns the samples to forward; often none.
  std::vector<GestureSample> keep(std::span<const GestureSample> samples);

 private:
  std::int64_t period_ns_;
  std::int64_t due_ns_ = 0;
  std::int64_t last_ns_ = 0;
  bool started_ = false;
};

/// The samples of a received live frame: decoded when somebody first asks, and once however many ask.
class LiveSamples {
 public:
  /// `data` must outlive this.
  explicit LiveSamples(std::string_view data) : data_(data) {}

  /// Empty: the bytes are no chunk.
  std::span<const GestureSample> all();
  /// As the station declared it. Call only if all() is not empty.
  [[nodiscard]] const Resolution& resolution() const { return resolution_; }
  [[nodiscard]] bool decoded() const { return decoded_; }

 private:
  std::string_view data_;
  std::vector<GestureSample> samples_;
  Resolution resolution_;
  bool decoded_ = false;
};

/// A station's frames at one lower rate (of kThinnedRates_hz), for all who watch it at that rate: they get
/// the same frames, with numbers of their own. Thread: one.
class ThinnedFrames {
 public:
  /// rate_hz > 0
  explicit ThinnedFrames(double rate_hz) : decimator_(rate_hz) {}

  /// The frame to send for the station's next one; null: it has no sample of the grid. `station`: its name.
  Frame next(const LiveFrameView& frame, LiveSamples& samples, std::string_view station);
  /// A frame that was thinned to this rate already; only its number is another one.
  Frame asItIs(const LiveFrameView& frame, std::string_view station);
  /// The next frame's number says nothing about what lies between it and the last one.
  void otherNumbers() { last_of_station_.reset(); }

 private:
  void keepGap(std::uint64_t frame_seq);
  Decimator decimator_;
  std::uint64_t number_ = 0;  // of the next frame: keeps the gaps of the station's numbers
  std::optional<std::uint64_t> last_of_station_;
};

}  // namespace needlelab
