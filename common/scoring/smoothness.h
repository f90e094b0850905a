/// Smoothness of a movement from its speed profile: SPARC and LDLJ. Both are below 0, nearer to 0 is
/// smoother.
#pragma once

#include <optional>
#include <span>

namespace needlelab {

inline constexpr double kSparcCutoffHz = 10;
inline constexpr double kSparcThreshold =
    0.05;  ///< of the spectrum's maximum: below it a high frequency does not count
inline constexpr unsigned kSparcPadding = 4;  ///< the spectrum is padded to 2^4 times the next power of two
/// Longer movements have no smoothness worth the name, and their spectrum would not fit into a few megabytes.
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
