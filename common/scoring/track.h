/// Converts a recording to a smooth motion at one fixed rate, the basis of lengths, speeds and swept areas;
/// and measures its smoothness. Private to this folder.
///
/// Each quantity is taken as piecewise linear between samples, averaged over bins of `kAnalysisPeriod_s`,
/// then smoothed by a Gaussian that halves the power at `kAnalysisCutoffHz`, forward and backward alike (no
/// delay), reflected about its end points (the ends do not move). The result does not depend on the loop's
/// rate, and smoothing never makes a path longer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/geometry.h"
#include "common/scoring/recorded_samples.h"
#include "common/scoring/step_work.h"

namespace needlelab {

inline constexpr double kAnalysisPeriod_s = 0.01;
/// Intended hand movement lies below it; tremor (8–12 Hz) and the device's encoder steps are damped.
inline constexpr double kAnalysisCutoffHz = 6;
/// Missing ticks up to this long are bridged by straight lines; nothing is assumed about longer gaps.
inline constexpr double kLongestBridge_s = 0.1;

/// One point of the motion.
struct TrackPoint {
  Vec3 p_WT_m;             ///< tip, smoothed
  Vec3 axis_W;             ///< needle's axis from hub to tip, smoothed, unit
  Vec3 v_WT_mps;           ///< tip's velocity
  double insertion_m = 0;  ///< mean over the bin
};

/// A stretch of the recording without a long gap.
struct Run {
  std::size_t first = 0,
              last = 0;  ///< samples, both included (indices into the list given to `cleaned`'s result)
  double start_s = 0;    ///< of the first sample, since the recording's first
  double period_s = 0;   ///< between points: at most `kAnalysisPeriod_s`, such that both ends are points
  std::vector<TrackPoint> points;  ///< at start_s + i·period_s; a single point if the run is one sample
  std::vector<double> inside;   ///< share of the time between points i and i+1 in which the tip was in tissue
  std::vector<Vec3> force_W_N;  ///< on the hand, mean over the time between points i and i+1
};

/// Returns the usable samples: ticks strictly ascending; positions, orientations, forces and lengths finite
/// and not absurd (1 km, 1 MN). Other samples are left out, as if their ticks had been missed. Nearly always
/// all samples are usable, and nothing is copied: the result is `samples` itself; otherwise it is in
/// `storage`.
std::span<const GestureSample> cleaned(std::span<const GestureSample> samples,
                                       std::vector<GestureSample>& storage);

/// The same for a part of a recording, in place. `last_tick`, `any`: of the usable samples before it, and
/// whether there are such; set to those after it.
void keepUsable(std::vector<GestureSample>& samples, std::uint64_t& last_tick, bool& any);

/// Seconds between two ticks.
inline double secondsBetween(const GestureSample& a, const GestureSample& b, double rate_hz) {
  return static_cast<double>(b.tick - a.tick) / rate_hz;
}

/// Whether the tip was in tissue in that tick, according to the engine.
inline bool isInside(const GestureSample& sample) {
  return sample.layer >= 0;
}

/// The runs of a recording, in order. Memory: some 220 bytes a point; a tenth of a point per sample at 1 kHz
/// without gaps, and up to 11 at the lowest rate with gaps of nearly 0.1 s: call checkMotion (motion_cost.h)
/// before, unless the samples are one's own.
std::vector<Run> runsOf(const RecordedSamples& samples, double rate_hz);
/// The same of samples in memory.
std::vector<Run> runsOf(std::span<const GestureSample> samples, double rate_hz);

/// runsOf() in steps. `samples` must outlive it. Thread: one at a time.
class RunsInSteps {
 public:
  RunsInSteps(const RecordedSamples& samples, double rate_hz);
  ~RunsInSteps();
  RunsInSteps(const RunsInSteps&) = delete;
  RunsInSteps& operator=(const RunsInSteps&) = delete;

  /// Finds and fills some more of the runs. True: all are there.
  bool step(StepWork& work);
  /// Once all are there.
  std::vector<Run> take() { return std::move(runs_); }

 private:
  class Filling;
  const RecordedSamples& samples_;
  const double rate_hz_;
  std::vector<Run> runs_;
  std::size_t next_ = 0, filled_ = 0;  // sample; runs
  std::unique_ptr<Filling> filling_;   // of the run that comes next
};

inline constexpr double kSparcCutoffHz = 10;
inline constexpr double kSparcThreshold =
    0.05;  ///< share of the spectrum's maximum; high frequencies below it do not count
inline constexpr unsigned kSparcPadding = 4;  ///< the spectrum is padded to 2^4 times the next power of two
/// Smoothness has no meaning for longer movements, and their spectrum would not fit into a few megabytes.
inline constexpr std::size_t kLongestProfile = 65'536;

/// Spectral arc length (Balasubramanian, Melendez-Calderon, Burdet 2012; the form of 2015): minus the length
/// of the amplitude spectrum's curve, normalised to height 1, from 0 Hz to the last frequency below the
/// cut-off that reaches the threshold, that width normalised to 1. For exp(−5 t²), t ∈ [−1, 1) at 100 Hz:
/// −1.41403. Empty: fewer than 3 samples, more than `kLongestProfile`, no movement, or a spectrum of a single
/// line.
std::optional<double> sparc(std::span<const double> speed_mps, double rate_hz);

/// Log dimensionless jerk of speed (same source): −ln((duration³/peak²) ∫ (d²v/dt²)² dt), second differences,
/// duration = samples/rate. For the same profile: −5.81636. Empty: fewer than 3 samples, no movement, or no
/// jerk at all.
std::optional<double> ldlj(std::span<const double> speed_mps, double rate_hz);

}  // namespace needlelab
