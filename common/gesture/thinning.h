/// Thins an old recording: retention keeps fewer samples of the gesture.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "common/gesture/sample.h"

namespace needlelab {

/// Describes Thinner's method; stored with each thinned recording.
inline constexpr std::string_view kThinningMethod = "triangle mean";

/// Keeps the first and the last sample, and the first one at or after each point of a grid of `rate_hz /
/// target_hz` ticks. Kept samples keep their ticks and times. Their positions, orientations, speeds, forces,
/// lengths and plunger are means over the surrounding samples, weighted by a triangle that falls to 0 one
/// grid step away: a low-pass without delay, which does not change steady motion and damps motion that the
/// lower rate could not represent; the first and the last sample do not change. Each kept sample collects
/// from all samples since the previous kept sample: the union of flags and buttons, the longest device and
/// engine times, and the newest fault, so that none is lost; phase and layer are the sample's own. A new grid
/// begins where ticks do not ascend. Memory: about two grid steps of samples. Thread: one at a time.
class Thinner {
 public:
  /// Both above 0 (asserted). A target at or above the rate keeps every sample as it is.
  Thinner(double rate_hz, double target_hz);

  /// Appends the finished samples to `out`.
  void add(const GestureSample& sample, std::vector<GestureSample>& out);
  /// Appends the remaining samples. Afterwards the thinner can be used for another gesture.
  void finish(std::vector<GestureSample>& out);
  /// How often a sample of the window was read, added to a mean, or moved. For tests of the cost.
  [[nodiscard]] std::uint64_t steps() const { return steps_; }

 private:
  struct Center {
    GestureSample sample;  ///< with flags, times and fault of its group
    bool exact = false;
  };
  void startGrid(const GestureSample& first);
  void keep(const GestureSample& sample, bool exact);
  void settle(std::vector<GestureSample>& out, bool all);
  [[nodiscard]] GestureSample meanAround(const Center& center);

  const double step_ticks_;
  double due_ = 0;  ///< next point of the grid, ticks since its first
  std::uint64_t first_tick_ = 0;
  std::vector<GestureSample> window_;
  std::vector<Center> centers_;         ///< kept samples that still wait for their neighbours
  std::optional<GestureSample> group_;  ///< collected since the last kept sample
  std::uint64_t steps_ = 0;
};

/// Returns a resolution that is `factor` times as coarse; a lossless kind stays lossless, and no step exceeds
/// 1.
Resolution coarser(const Resolution& resolution, double factor);

}  // namespace needlelab
