/// Measures of a run of the closed loop.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "client/sim/stability/plant.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// A stretch of time of a run, [from_s, to_s).
struct TimeWindow {
  double from_s = 0, to_s = 0;
};
/// The ticks of the run in the window.
std::span<const PlantTick> ticksIn(const PlantRun& run, TimeWindow window);

/// Force of the source along `direction` (unit, in W) per tick, before the gate.
std::vector<double> forceAlong(std::span<const PlantTick> ticks, Vec3 direction);

/// Largest minus smallest; 0 for nothing.
double peakToPeak(std::span<const double> signal);
double rmsOf(std::span<const double> signal);  ///< 0 for nothing

/// A Butterworth band: high-pass at `low_hz` and, when below half of the rate, low-pass at `high_hz`, each of
/// `order` (2, 4, 6 or 8; bilinear transform, corner frequencies prewarped).
struct BandFilter {
  double low_hz = 50, high_hz = 500;
  int order = 4;
};
/// Returns the filtered signal. The filter starts as if the signal had always had its first value.
std::vector<double> bandPassed(std::span<const double> signal, double rate_hz, const BandFilter& band);

/// RMS in the band over the window of a run; the filter starts at the run's beginning.
double chatterOf(const PlantRun& run, Vec3 direction, TimeWindow window, const BandFilter& band);

/// How often the needle comes to STOPPED in these ticks; `before` is its phase ahead of them.
int stopsIn(std::span<const PlantTick> ticks, Phase before);

bool allFinite(const PlantRun& run);
double maxForce_N(const PlantRun& run);

/// The declared releases: at a tick with one of these flags a fall of the force is explained. A move of the
/// trajectory only lowers what the fixture holds.
inline constexpr std::uint32_t kDeclaredReleases = kFlagExit | kFlagLayerChange | kFlagRupture | kFlagTurn;

/// By how much the forces that make up a report fell at a declared release: cutting, attracted, friction,
/// puncture and clamping, each as far as zero. 0 where `now` has none. A rise of one of them is no release.
double declaredFall_N(const StepReport& before, const StepReport& now);

/// The part of the force step between two consecutive ticks that nothing explains: |Δf| − ΣK·|Δp|/slant −
/// declaredFall_N, at least 0. ΣK = `axial_stiffness` + twice the greater clamping stiffness, for k′e beside
/// k; `slant` = c.
double unexplainedStep_N(Vec3 p_before_m, const StepReport& before, Vec3 p_m, const StepReport& report,
                         double axial_stiffness_N_per_m, double slant = 1);
/// The greatest of a run (straight insertions, slant 1).
double maxUnexplainedStep_N(const PlantRun& run);

/// True if the signal grows steadily: its AC part grows by a tenth from each quarter to the next, in all by
/// half, and ends above `floor`.
bool grows(std::span<const double> signal, double floor);

}  // namespace needlelab
