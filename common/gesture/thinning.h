/// A gesture with fewer samples: what retention keeps of an old recording.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "common/gesture/sample.h"

namespace needlelab {

/// How Thinner works, as it is noted beside what it made.
inline constexpr std::string_view kThinningMethod = "triangle mean";

/// Keeps the first sample at or behind each point of a grid of `rate_hz / target_hz` ticks, the first sample
/// and the last. Ticks and times are those of the samples kept. Their places, orientations, speeds, forces,
/// lengths and plunger are means over the samples around, weighted by a triangle that falls to 0 one grid
/// step away: a low-pass without delay, which leaves steady motion as it is and damps what the lower rate
/// could not show; the first and the last sample stay as they are. Flags and buttons are all those, device
/// and engine times the longest, the fault the newest that occurred since the sample kept before, so that
/// none is lost; phase and layer are the sample's own. Where ticks do not ascend a new grid begins. Memory:
/// some two grid steps of samples. Thread: one at a time.
class Thinner {
 public:
  /// Both above 0 (asserted). A target at or above the rate keeps every sample as it is.
  Thinner(double rate_hz, double target_hz);

  /// Appends to `out` what is decided by now.
  void add(const GestureSample& sample, std::vector<GestureSample>& out);
  /// The rest. Afterwards it may begin again.
  void finish(std::vector<GestureSample>& out);

 private:
  struct Center {
    GestureSample sample;  ///< with flags, times and fault of its group
    bool exact = false;
  };
  void startGrid(const GestureSample& first);
  void keep(const GestureSample& sample, bool exact);
  void settle(std::vector<GestureSample>& out, bool all);
  [[nodiscard]] GestureSample meanAround(const Center& center) const;

  const double step_ticks_;
  double due_ = 0;  ///< next point of the grid, ticks since its first
  std::uint64_t first_tick_ = 0;
  std::vector<GestureSample> window_;
  std::vector<Center> centers_;         ///< kept, their neighbours still to come
  std::optional<GestureSample> group_;  ///< what was met since the last kept sample
};

/// Steps that are `factor` times as coarse; a lossless kind stays lossless, none goes beyond 1.
Resolution coarser(const Resolution& resolution, double factor);

}  // namespace needlelab
