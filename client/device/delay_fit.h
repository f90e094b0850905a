/// Computes how late a device renders a force, from a small known force and the encoders' response. Pure
/// computation; client/station/run/checks/measure_delay.h measures.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// One tick of a measurement, along the probed axis.
struct ResponseSample {
  double force_N = 0;  ///< given to the device in this tick
  double place_m = 0;  ///< as the encoders reported it in this tick, before the force
};

/// Models the handle in the hand as m ẍ + b ẋ + k x = F, where F is the given force, held for a tick,
/// `delay_s` late and with a first-order lag.
struct DelayFit {
  double delay_s = 0, lag_s = 0;
  double mass_kg = 0, damping_Ns_per_m = 0, stiffness_N_per_m = 0;  ///< of handle and hand
  double unexplained = 0;     ///< share of the response that the model does not explain, rms
  double halves_apart_s = 0;  ///< between the totals of the measurement's first and second half
  /// The delay for stiffness limits: up to some 30 Hz, a lag acts as an equal delay.
  [[nodiscard]] double total_s() const { return delay_s + lag_s; }
};

/// Returns a force for `seconds` (rounded down to whole periods of the pattern, 0.5 s each): a sum of sines
/// of 14 to 68 Hz, at most `max_N`. One number per tick.
std::vector<double> probeForce(double rate_hz, double seconds, double max_N);

/// Fits delay and lag, [0, 15 ms] each. Skips the first period, in which the hand settles. `handle_kg`: the
/// device's apparent mass. Errors: kInvalidInput (fewer than 6 periods), kFailed (no force, or a response
/// that is not a handle's in a hand: more than 5 % unexplained, a stiffness or damping clearly below 0, or a
/// mass that is not the handle's with at most 2 kg of hand and forearm).
Result<DelayFit> fitDelay(std::span<const ResponseSample> samples, double rate_hz, double handle_kg);

}  // namespace needlelab
