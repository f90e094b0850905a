/// The cost of a recording's smooth motion (track.h), computed before anything is allocated for it: rate and
/// ticks of a recording come from a station, which may be broken or hostile.
#pragma once

#include <cstddef>
#include <cstdint>

#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/scoring/motion/recorded_samples.h"

namespace needlelab {

/// Maximum time between two points of the motion.
inline constexpr double kAnalysisPeriod_s = 0.01;
/// Intended hand movement is below this; tremor (8–12 Hz) and the device's encoder steps are damped.
inline constexpr double kAnalysisCutoffHz = 6;
/// Missing ticks up to this long are bridged by straight lines; nothing is assumed about longer gaps.
inline constexpr double kLongestBridge_s = 0.1;

/// An hour of motion at 100 Hz, twice the longest session that a server scores: 30 minutes at 1 kHz
/// (kMaxScoredSamples). Needs about 220 bytes per point while it is made, 80 MB.
inline constexpr std::uint64_t kMaxMotionPoints = 360'000;
/// A point is smoothed with at most 10 values on either side in a run of many points, and with many more in a
/// short run between two gaps: with 89 in a run of two ticks at 1 kHz, with 3,534 at 40 kHz. No person's
/// movement has so many short runs that the total is twice the normal maximum.
inline constexpr std::uint64_t kMaxSmoothingTerms = 20 * kMaxMotionPoints;

struct MotionCost {
  std::uint64_t points = 0;  ///< of all runs
  std::uint64_t terms = 0;   ///< points × values on one side of the kernel, of all runs
};

/// `rate_hz` must be above 0. Reads all samples once (check samples.fault() afterwards) and allocates
/// nothing.
MotionCost motionCost(const RecordedSamples& samples, double rate_hz);

/// Errors: kInvalidInput if the motion would exceed kMaxMotionPoints or kMaxSmoothingTerms; the message
/// begins with "its motion" and gives number and limit. `scoreGesture` and `tipPathOf` then return nothing.
Status checkMotion(const RecordedSamples& samples, double rate_hz);

/// checkMotion() in steps. `samples` must outlive it. Thread: one at a time.
class MotionCheck {
 public:
  MotionCheck(const RecordedSamples& samples, double rate_hz) : samples_(samples), rate_hz_(rate_hz) {}
  /// Counts some more samples. Returns true when all are counted.
  bool step(StepWork& work);
  /// Call when all are counted.
  [[nodiscard]] const MotionCost& cost() const { return cost_; }
  [[nodiscard]] Status status() const;

 private:
  void addRun();

  const RecordedSamples& samples_;
  const double rate_hz_;
  std::size_t next_ = 0;
  GestureSample first_, last_;  // of the run so far
  MotionCost cost_;
};

/// The number of steps between points in a run of more than one sample with this duration; at least 1.
std::size_t motionSteps(double duration_s);

/// The Gaussian's standard deviation, in points, for points that are `period_s` apart; its weights extend to
/// `kernelReach` points on either side.
double kernelSigma(double period_s);
std::size_t kernelReach(double period_s);

}  // namespace needlelab
