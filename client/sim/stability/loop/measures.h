/// Measures of a closed-loop run.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "client/sim/stability/loop/plant.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// A time range of a run, [from_s, to_s).
struct TimeWindow {
  double from_s = 0, to_s = 0;
};
/// The run's ticks in the window.
std::span<const PlantTick> ticksIn(const PlantRun& run, TimeWindow window);

/// Force of the source along `direction` (unit, in W) per tick, before the gate.
std::vector<double> forceAlong(std::span<const PlantTick> ticks, Vec3 direction);

/// Maximum minus minimum; 0 if empty.
double peakToPeak(std::span<const double> signal);
double rmsOf(std::span<const double> signal);  ///< 0 if empty
/// Each value minus the mean of the `around` values before and after it, fewer at the ends: a swing without
/// the creep of a relaxing wall.
std::vector<double> aboutSlowPart(std::span<const double> signal, std::size_t around);

/// A Butterworth band: high-pass at `low_hz` and, if below half the rate, low-pass at `high_hz`, each of
/// `order` (2, 4, 6 or 8; bilinear transform, prewarped corner frequencies).
struct BandFilter {
  double low_hz = 50, high_hz = 500;
  int order = 4;
};
/// Returns the filtered signal. The filter starts as if the signal had always had its first value.
std::vector<double> bandPassed(std::span<const double> signal, double rate_hz, const BandFilter& band);

/// RMS in the band over a window of a run; the filter starts at the run's beginning.
double chatterOf(const PlantRun& run, Vec3 direction, TimeWindow window, const BandFilter& band = {});

/// How often the needle enters STOPPED in these ticks; `before` is the preceding phase.
int stopsIn(std::span<const PlantTick> ticks, Phase before);

bool allFinite(const PlantRun& run);
double maxForce_N(const PlantRun& run);

/// The greatest energy that the hand receives in any second of these ticks, in J: the mean of `grip_J` over a
/// second minus that over the second before, so that what springs take and return within a swing does not
/// count, nor what the hand paid earlier. At least 0; empty for less than two seconds.
std::optional<double> greatestInASecond_J(std::span<const PlantTick> ticks, double rate_hz);

/// The declared releases: at a tick with one of these flags a fall of the force is explained. A change of
/// trajectory only lowers the fixture's force.
inline constexpr std::uint32_t kDeclaredReleases = kFlagExit | kFlagLayerChange | kFlagRupture | kFlagTurn;

/// The unexplained part of the force step between two consecutive ticks: |Δf| − ΣK·|Δp|/slant, at a declared
/// release also minus the fall of cutting, attracted, friction, puncture and clamping, each down to zero at
/// most; at least 0. ΣK = `axial_stiffness` + twice the larger clamping stiffness, to cover k′e in addition
/// to k; that acts over the change of the insertion, where that is more than |Δp|/slant. `slant` = c.
double unexplainedStep_N(Vec3 p_before_m, const StepReport& before, Vec3 p_m, const StepReport& report,
                         double axial_stiffness_N_per_m, double slant = 1);
/// The maximum over a run (straight insertions, slant 1).
double maxUnexplainedStep_N(const PlantRun& run);

/// True if the signal grows steadily: its AC part grows by a tenth from each quarter to the next, by half in
/// total, and ends above `floor`.
bool grows(std::span<const double> signal, double floor);

}  // namespace needlelab
