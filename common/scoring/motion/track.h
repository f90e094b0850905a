/// Converts a recording to a smooth motion at one fixed rate, the basis of lengths, speeds and swept areas,
/// and measures its smoothness. Private to common/scoring.
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
#include "common/scoring/motion/motion_cost.h"
#include "common/scoring/motion/recorded_samples.h"

namespace needlelab {

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
              last = 0;  ///< samples, both included (numbers of the recording's usable samples)
  double start_s = 0;    ///< time of the first sample, since the recording's first
  double period_s = 0;   ///< time between points: at most `kAnalysisPeriod_s`, such that both ends are points
  std::vector<TrackPoint> points;  ///< at start_s + i·period_s; a single point if the run is one sample
  std::vector<double> inside;   ///< share of the time between points i and i+1 in which the tip was in tissue
  std::vector<Vec3> force_W_N;  ///< on the hand, mean over the time between points i and i+1
};

/// The runs of a recording, in order. Memory: about 220 bytes per point; 0.1 points per sample at 1 kHz
/// without gaps, up to 11 at the lowest rate with gaps of nearly 0.1 s. Call checkMotion (motion_cost.h)
/// first, unless the samples are trusted.
std::vector<Run> runsOf(const RecordedSamples& samples, double rate_hz);
/// The same for samples in memory.
std::vector<Run> runsOf(std::span<const GestureSample> samples, double rate_hz);

/// runsOf() in steps. `samples` must outlive it. Thread: one at a time.
class RunsInSteps {
 public:
  RunsInSteps(const RecordedSamples& samples, double rate_hz);
  ~RunsInSteps();
  RunsInSteps(const RunsInSteps&) = delete;
  RunsInSteps& operator=(const RunsInSteps&) = delete;

  /// Finds and fills some more runs. Returns true when all are done.
  bool step(StepWork& work);
  /// Call when all are done.
  std::vector<Run> take() { return std::move(runs_); }

 private:
  class Filling;
  const RecordedSamples& samples_;
  const double rate_hz_;
  std::vector<Run> runs_;
  std::size_t next_ = 0, filled_ = 0;  // sample; runs
  std::unique_ptr<Filling> filling_;   // of the next run
};

/// The tip's path from the first entry to the last exit in the limb's frame, `path_rate_hz` points per
/// second, in m; joins the stretches between long gaps. Stops after `most` points. Empty if it was never in
/// tissue.
std::vector<Vec3> pathInTissue(std::span<const Run> runs, const Pose& X_WL, double path_rate_hz,
                               std::size_t most);

inline constexpr double kSparcCutoffHz = 10;
inline constexpr double kSparcThreshold =
    0.05;  ///< share of the spectrum's maximum; high frequencies below it do not count
inline constexpr unsigned kSparcPadding = 4;  ///< the spectrum is padded to 2^4 times the next power of two
/// Smoothness is meaningless for longer movements, and their spectrum would not fit into a few megabytes.
inline constexpr std::size_t kLongestProfile = 65'536;

/// Spectral arc length (Balasubramanian, Melendez-Calderon, Burdet 2012; the form of 2015): minus the length
/// of the amplitude spectrum's curve, normalised to height 1, from 0 Hz to the last frequency below the
/// cut-off at or above the threshold, with that width normalised to 1. For exp(−5 t²), t ∈ [−1, 1) at 100 Hz:
/// −1.41403. Empty: fewer than 3 samples, more than `kLongestProfile`, no movement, or a spectrum of a single
/// line.
std::optional<double> sparc(std::span<const double> speed_mps, double rate_hz);

/// Log dimensionless jerk of speed (same source): −ln((duration³/peak²) ∫ (d²v/dt²)² dt), second differences,
/// duration = samples/rate. For the same profile: −5.81636. Empty: fewer than 3 samples, no movement, or no
/// jerk at all.
std::optional<double> ldlj(std::span<const double> speed_mps, double rate_hz);

}  // namespace needlelab
