#include "common/scoring/motion/motion_cost.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace needlelab {

std::size_t motionSteps(double duration_s) {
  return std::max<std::size_t>(1, static_cast<std::size_t>(std::ceil(duration_s / kAnalysisPeriod_s - 1e-9)));
}

double kernelSigma(double period_s) {
  // |H(f)|² = exp(−(2π f σ)²) is ½ at the cut-off
  return std::sqrt(std::numbers::ln2) / (2 * std::numbers::pi * kAnalysisCutoffHz) / period_s;
}

std::size_t kernelReach(double period_s) {
  return static_cast<std::size_t>(std::ceil(4 * kernelSigma(period_s)));
}

void MotionCheck::addRun() {
  if (first_.tick == last_.tick) {
    ++cost_.points;  // not smoothed
    return;
  }
  const double duration_s = secondsBetween(first_, last_, rate_hz_);
  const std::size_t steps = motionSteps(duration_s);
  cost_.points += steps + 1;
  cost_.terms += (steps + 1) * kernelReach(duration_s / static_cast<double>(steps));
}

bool MotionCheck::step(StepWork& work) {
  for (; next_ < samples_.size(); ++next_) {
    if (work.isOver()) return false;
    work.spend(1);
    const GestureSample& next = samples_[next_];
    if (next_ == 0) {
      first_ = next;
    } else if (secondsBetween(last_, next, rate_hz_) > kLongestBridge_s) {
      addRun();
      first_ = next;
    }
    last_ = next;
    if (next_ + 1 == samples_.size()) addRun();
  }
  return true;
}

Status MotionCheck::status() const {
  if (cost_.points > kMaxMotionPoints)
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("its motion has {} points at {:.0f} Hz, at most {} are scored: {} samples at {} Hz "
                    "last too long",
                    cost_.points, 1 / kAnalysisPeriod_s, kMaxMotionPoints, samples_.size(), rate_hz_)};
  if (cost_.terms > kMaxSmoothingTerms)
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("its motion at {} Hz is in so many short pieces between gaps that smoothing takes {} "
                    "terms, at most {} are scored",
                    rate_hz_, cost_.terms, kMaxSmoothingTerms)};
  return {};
}

MotionCost motionCost(const RecordedSamples& samples, double rate_hz) {
  MotionCheck check(samples, rate_hz);
  StepWork all = StepWork::all();
  check.step(all);
  return check.cost();
}

Status checkMotion(const RecordedSamples& samples, double rate_hz) {
  MotionCheck check(samples, rate_hz);
  StepWork all = StepWork::all();
  check.step(all);
  return check.status();
}

}  // namespace needlelab
