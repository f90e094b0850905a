#include "client/device/delay_fit.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "client/device/hand/hand.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

/// A handle in a hand, integrated independently of SimulatedDevice.
struct Bench {
  int delay_ticks = 1;
  double lag_s = 0, mass_kg = 0.35, damping_Ns_per_m = 4.7, stiffness_N_per_m = 300;
  double tremor_m = 100e-6, drift_m = 1e-3, encoder_step_m = 10e-6, dry_friction_N = 0;
  double rate_hz = 1000;
  std::uint64_t seed = 1;
};

std::vector<ResponseSample> measured(const Bench& bench, double seconds = 10) {
  const auto force = probeForce(bench.rate_hz, seconds, 0.5);
  std::vector<ResponseSample> samples;
  HandRandom random(bench.seed);
  double hz[3], phase[3];
  for (int i = 0; i < 3; ++i) hz[i] = 8 + 4 * random.uniform(), phase[i] = 6 * random.uniform();
  constexpr int kSteps = 20;
  const double step_s = 1 / (bench.rate_hz * kSteps);
  double x = 0, v = 0, acting = 0, t = 0;
  for (std::size_t i = 0; i < force.size(); ++i) {
    const double step = bench.encoder_step_m;
    samples.push_back({force[i], step > 0 ? std::floor(x / step + 0.5) * step : x});
    const auto due = static_cast<int>(i) - bench.delay_ticks;
    const double given = due >= 0 ? force[static_cast<std::size_t>(due)] : 0;
    for (int k = 0; k < kSteps; ++k, t += step_s) {
      double aim = bench.drift_m * std::sin(2.5 * t);
      for (int n = 0; n < 3; ++n)
        aim += bench.tremor_m / 3 * std::sin(2 * std::numbers::pi * hz[n] * t + phase[n]);
      acting = bench.lag_s > 0 ? acting + (given - acting) * step_s / bench.lag_s : given;
      v += (acting - bench.damping_Ns_per_m * v - bench.stiffness_N_per_m * (x - aim)) / bench.mass_kg *
           step_s;
      const double loss = bench.dry_friction_N * step_s / bench.mass_kg;
      v = std::abs(v) > loss ? v - std::copysign(loss, v) : 0;
      x += v * step_s;
    }
  }
  return samples;
}

TEST(DelayFit, findsDelayLagAndMassBehindTremorDriftAndEncoder) {
  for (const Bench& bench :
       {Bench{}, Bench{0}, Bench{2, 2e-3, 0.35, 2.6, 90}, Bench{5, 0, 0.35, 9.7, 1000},
        Bench{3, 1e-3, 1.0, 8, 500}, Bench{1, 8e-3}, Bench{1, 0, 0.6, 4, 200, 200e-6, 2e-3, 20e-6, 0.05}}) {
    SCOPED_TRACE(testing::Message() << bench.delay_ticks << " ticks, " << bench.lag_s << " s, "
                                    << bench.mass_kg << " kg");
    const auto fit = fitDelay(measured(bench), bench.rate_hz);
    ASSERT_TRUE(fit.ok()) << fit.error().message;
    // over twelve seeds the worst error was 0.26 ms; with 8 ms of lag 0.9 ms
    EXPECT_NEAR(fit->total_s(), bench.delay_ticks / bench.rate_hz + bench.lag_s,
                bench.lag_s > 5e-3 ? 1e-3 : 0.5e-3);
    EXPECT_NEAR(fit->mass_kg, bench.mass_kg, 0.15 * bench.mass_kg);
    EXPECT_LT(fit->halves_apart_s, 1e-3);
  }
}

TEST(DelayFit, ofAnExactEncoderInARestingHandIsExact) {
  Bench bench{3, 2e-3};
  bench.tremor_m = bench.drift_m = bench.encoder_step_m = 0;
  const auto fit = fitDelay(measured(bench), bench.rate_hz);
  ASSERT_TRUE(fit.ok());
  // the independent integration has steps of 50 µs
  EXPECT_NEAR(fit->delay_s, 3e-3, 0.1e-3);
  EXPECT_NEAR(fit->lag_s, 2e-3, 0.1e-3);
  EXPECT_NEAR(fit->damping_Ns_per_m, bench.damping_Ns_per_m, 0.15);
  EXPECT_NEAR(fit->stiffness_N_per_m, bench.stiffness_N_per_m, 10);
}

TEST(DelayFit, aRateOf4kHzFindsTheSameTime) {
  Bench bench{6, 1e-3};
  bench.rate_hz = 4000;
  const auto fit = fitDelay(measured(bench), bench.rate_hz);
  ASSERT_TRUE(fit.ok()) << fit.error().message;
  EXPECT_NEAR(fit->total_s(), 2.5e-3, 0.3e-3);
}

TEST(DelayFit, refusesWhatDoesNotAnswer) {
  Bench stuck;
  stuck.dry_friction_N = 2;
  EXPECT_THAT(fitDelay(measured(stuck), 1000).error().message, HasSubstr("did not answer the force"));
  EXPECT_THAT(fitDelay(measured({}, 2), 1000).error().message, HasSubstr("2.0 s were measured; 3.0 s"));
  const std::vector<ResponseSample> nothing(10000);
  EXPECT_THAT(fitDelay(nothing, 1000).error().message, HasSubstr("was given no force"));
}

TEST(DelayFit, theProbeStaysWithinItsForceAndRepeats) {
  const auto force = probeForce(1000, 2.3, 0.5);
  ASSERT_EQ(force.size(), 2000u) << "whole periods of half a second";
  double most = 0, sum = 0;
  for (std::size_t i = 0; i < force.size(); ++i) {
    most = std::max(most, std::abs(force[i]));
    sum += force[i];
    EXPECT_EQ(force[i], force[i % 500]);
  }
  EXPECT_NEAR(most, 0.5, 1e-12);
  EXPECT_NEAR(sum, 0, 1e-9) << "the hand is not pushed away";
}

}  // namespace
}  // namespace needlelab
