/// What a viewer saw of a live stream: how much, what was lost, how late it was.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "needlelab/live.pb.h"

namespace needlelab {

class LiveStats {
 public:
  /// A frame with so many samples, received at this wall-clock time.
  void add(const pb::LiveFrame& frame, std::size_t samples, std::int64_t received_unix_ns);
  /// The stream starts anew (another connection, another station): its numbers do not continue the old ones.
  void streamRestarts() { last_seq_.reset(); }

  [[nodiscard]] std::uint64_t frames() const { return frames_; }
  [[nodiscard]] std::uint64_t samples() const { return samples_; }
  /// Gaps in the frames' numbers, wherever they arose: at the station, or in this viewer's queue at the
  /// server.
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  [[nodiscard]] double lastLatencyMs() const { return last_latency_ms_; }
  /// q in [0, 1]; 0 when nothing came. From the newest 100,000 frames: half an hour at the full rate.
  [[nodiscard]] double latencyMs(double q) const;

 private:
  static constexpr std::size_t kKept = 100'000;
  std::uint64_t frames_ = 0, samples_ = 0, dropped_ = 0;
  std::optional<std::uint64_t> last_seq_;
  double last_latency_ms_ = 0;
  std::vector<float> latencies_ms_ = std::vector<float>(kKept);  // all of it now: memory stays flat
};

}  // namespace needlelab
