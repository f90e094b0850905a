/// How late a device renders a force, from a small known force and what the encoders say to it. Pure
/// computation (client/station/run/measure_delay.h measures).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// One tick of a measurement, along the probed axis.
struct ResponseSample {
  double force_N = 0;  ///< that the device was given in this tick
  double place_m = 0;  ///< as the encoders reported it in this tick, before the force
};

/// The handle in the hand as m ẍ + b ẋ + k x = F, where F is the force given, held for a tick, `delay_s` late
/// and behind a first-order lag.
struct DelayFit {
  double delay_s = 0, lag_s = 0;
  double mass_kg = 0, damping_Ns_per_m = 0, stiffness_N_per_m = 0;  ///< of handle and hand
  double unexplained = 0;     ///< share of the response that the model does not explain, rms
  double halves_apart_s = 0;  ///< between the totals of the measurement's first and second half
  /// What a limit of stiffness counts: up to some 30 Hz a lag is a delay of the same time.
  [[nodiscard]] double total_s() const { return delay_s + lag_s; }
};

/// A force that lasts `seconds` (rounded down to whole periods of the pattern, 0.5 s each): sines of 14 to
/// 68 Hz together, at most `most_N` at once. One number per tick.
std::vector<double> probeForce(double rate_hz, double seconds, double most_N);

/// Fits delay and lag, [0, 15 ms] each. The first period is left out, where the hand settles. Errors:
/// kInvalidInput (fewer than 6 periods), kFailed (no response, or one that the model does not explain).
Result<DelayFit> fitDelay(std::span<const ResponseSample> samples, double rate_hz);

}  // namespace needlelab
