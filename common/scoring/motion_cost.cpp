#include "common/scoring/motion_cost.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/scoring/track.h"

namespace needlelab {
namespace {

void addRun(MotionCost& cost, const GestureSample& first, const GestureSample& last, double rate_hz) {
  if (first.tick == last.tick) {
    ++cost.points;  // is not smoothed
    return;
  }
  const double duration_s = secondsBetween(first, last, rate_hz);
  const std::size_t steps = motionSteps(duration_s);
  cost.points += steps + 1;
  cost.terms += (steps + 1) * kernelReach(duration_s / static_cast<double>(steps));
}

}  // namespace

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

MotionCost motionCost(const RecordedSamples& samples, double rate_hz) {
  MotionCost cost;
  if (samples.empty()) return cost;
  GestureSample first = samples.front(), last = first;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const GestureSample& next = samples[i];
    if (secondsBetween(last, next, rate_hz) > kLongestBridge_s) {
      addRun(cost, first, last, rate_hz);
      first = next;
    }
    last = next;
  }
  addRun(cost, first, last, rate_hz);
  return cost;
}

Status checkMotion(const RecordedSamples& samples, double rate_hz) {
  const MotionCost cost = motionCost(samples, rate_hz);
  if (cost.points > kMostMotionPoints)
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("its motion has {} points at {:.0f} Hz, at most {} are scored: {} samples at {} Hz "
                    "last too long",
                    cost.points, 1 / kAnalysisPeriod_s, kMostMotionPoints, samples.size(), rate_hz)};
  if (cost.terms > kMostSmoothingTerms)
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("its motion at {} Hz is in so many short pieces between gaps that smoothing takes {} "
                    "terms, at most {} are scored",
                    rate_hz, cost.terms, kMostSmoothingTerms)};
  return {};
}

}  // namespace needlelab
