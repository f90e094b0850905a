/// How late a live picture is: from when a sample was due at its station to when the frame that shows it was
/// presented.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace needlelab {

/// By the wall clocks of station and viewer: true on one machine, or where both keep the time of day. Thread:
/// one.
class LatencyMeter {
 public:
  static constexpr std::size_t kKept = 20'000;  ///< newest live frames: 6 minutes of one station

  /// A live frame was taken into what the next picture shows; its last sample was due then.
  void fed(std::int64_t capture_unix_ns);
  /// That picture is on the screen now.
  void presented(std::int64_t now_unix_ns);
  /// What was fed is not shown (paused, another screen).
  void discard() { waiting_.clear(); }
  void clear();

  [[nodiscard]] std::size_t count() const { return shown_; }
  [[nodiscard]] double last_ms() const { return last_ms_; }
  /// q in [0, 1], over what is kept; 0 when nothing was shown.
  [[nodiscard]] double quantile_ms(double q) const;

 private:
  std::vector<std::int64_t> waiting_;
  std::vector<float> shown_ms_;  // a ring
  std::size_t shown_ = 0;
  double last_ms_ = 0;
};

}  // namespace needlelab
