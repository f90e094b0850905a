/// What the smooth motion of a recording costs (track.h), counted before anything is allocated for it: the
/// rate and the ticks of a recording come from a station, which may be broken or hostile.
#pragma once

#include <cstddef>
#include <cstdint>

#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/scoring/recorded_samples.h"
#include "common/scoring/step_work.h"

namespace needlelab {

/// An hour of motion at 100 Hz, twice the longest session that a server scores: 30 minutes at 1 kHz
/// (kMaxScoredSamples). Some 220 bytes a point while it is made, 80 MB.
inline constexpr std::uint64_t kMostMotionPoints = 360'000;
/// A point is smoothed with at most 10 values on either side in a run of many points, and with many more in a
/// short run between two gaps: with 89 in a run of two ticks at 1 kHz, with 3,534 at 40 kHz. So many of them
/// that together all points take twice this much are no person's movement.
inline constexpr std::uint64_t kMostSmoothingTerms = 20 * kMostMotionPoints;

struct MotionCost {
  std::uint64_t points = 0;  ///< of all runs
  std::uint64_t terms = 0;   ///< points × values on one side of the kernel, of all runs
};

/// `rate_hz` above 0. Reads all samples once (see samples.fault() afterwards) and allocates nothing.
MotionCost motionCost(const RecordedSamples& samples, double rate_hz);

/// kInvalidInput: the motion would be beyond kMostMotionPoints or kMostSmoothingTerms; the message begins
/// with "its motion" and gives number and bound. `scoreGesture` and `tipPathOf` give nothing then.
Status checkMotion(const RecordedSamples& samples, double rate_hz);

/// checkMotion() in steps. `samples` must outlive it. Thread: one at a time.
class MotionCheck {
 public:
  MotionCheck(const RecordedSamples& samples, double rate_hz) : samples_(samples), rate_hz_(rate_hz) {}
  /// Counts some more samples. True: all are counted.
  bool step(StepWork& work);
  /// Once all are counted.
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

/// Steps between the points of a run of more than one sample that lasts so long; at least 1.
std::size_t motionSteps(double duration_s);

/// The Gaussian's standard deviation for points that are `period_s` apart, in points; its weights reach to
/// `kernelReach` points on either side.
double kernelSigma(double period_s);
std::size_t kernelReach(double period_s);

}  // namespace needlelab
