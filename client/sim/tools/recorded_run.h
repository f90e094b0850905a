/// The engine once more along what a device recorded, and how far its forces are from the recorded ones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// A run's force differs from the recorded one when it is further from it, in N: what a hand notices.
inline constexpr double kDiffers_N = 0.02;

/// |force of the run − recorded force|, over the ticks in tissue (in the run or the recording) whose force
/// the gate did not change.
struct RecordedDifference {
  std::size_t compared_ticks = 0;
  std::size_t differing_ticks = 0;                 ///< of these, above kDiffers_N
  std::size_t gate_ticks = 0;                      ///< not compared: the gate changed the force
  double median_N = 0, p99_N = 0, greatest_N = 0;  ///< 0 when nothing was compared
};

/// Sentences for a person, each with a line feed.
std::string differenceText(const RecordedDifference& difference);

/// Steps the engine along recorded samples. Each second of samples begins with the state that the samples
/// before it tell (`stepAsStored`: wall, phase, layer, ruptures); within it the engine decides by itself, on
/// poses that are rounded. Ticks that the station did not step are not stepped.
class RecordedRun {
 public:
  /// `model` must outlive the run.
  explicit RecordedRun(const SceneModel& model);

  /// Steps the next sample. Returns the engine's own report; of a tick that is not stepped, the last one with
  /// its flag.
  const StepReport& step(const GestureSample& sample);
  /// Of all samples so far.
  [[nodiscard]] RecordedDifference difference() const;

 private:
  const SceneModel& model_;
  std::uint64_t chunk_ticks_, ticks_ = 0;
  std::unique_ptr<SimState> told_, own_;  // by the samples; by the engine since this second's begin
  StepReport report_;
  std::size_t gate_ticks_ = 0;
  std::vector<double> differences_N_;
};

}  // namespace needlelab
