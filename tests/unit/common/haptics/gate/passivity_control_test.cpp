#include "common/haptics/gate/passivity_control.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "tests/support/realtime/no_alloc.h"

namespace needlelab::test {
namespace {

constexpr double kControlRate_hz = 1000, kControlPeriod_s = 1 / kControlRate_hz;

PassivitySettings withTank(double reserve_J, double capacity_J, std::uint32_t delay_ticks = 1) {
  PassivitySettings settings;
  settings.delay_ticks = delay_ticks;
  settings.reserve_J = reserve_J;
  settings.capacity_J = capacity_J;
  return settings;
}

// a handle on the z axis with a prescribed motion, and a force along it
struct Course {
  std::vector<double> z_m, force_N;  ///< force: rendered
  std::vector<double> level_J, share;
  // exact for a held wrench that acts `delay` ticks late
  [[nodiscard]] double given_J(std::size_t delay) const {
    double given = 0;
    for (std::size_t k = 1; k < z_m.size(); ++k)
      if (k >= 1 + delay) given += force_N[k - 1 - delay] * (z_m[k] - z_m[k - 1]);
    return given;
  }
};

Course driven(PassivityControl& control, std::size_t ticks, const std::function<double(double)>& z_m,
              const std::function<double(double, double)>& force_N) {
  Course out;
  for (std::size_t k = 0; k < ticks; ++k) {
    const double t = static_cast<double>(k) * kControlPeriod_s, z = z_m(t),
                 v = (z - z_m(t - kControlPeriod_s)) * kControlRate_hz;
    const Wrench wrench = control.limited({{0, 0, z}, {}}, true, {{0, 0, force_N(z, v)}, {}}, 0);
    control.rendered(wrench);
    out.z_m.push_back(z);
    out.force_N.push_back(wrench.force_N.z);
    out.level_J.push_back(control.state().level_J);
    out.share.push_back(control.state().share);
  }
  return out;
}

double swing(double t) {
  return 0.004 * std::sin(2 * std::numbers::pi * 3 * t);
}

TEST(PassivityControl, countsTheWorkOfAHeldAndLateWrenchExactly) {
  for (const std::uint32_t delay : {0u, 1u, 3u, 15u}) {
    PassivityControl control(withTank(1, 2, delay), kControlRate_hz);
    const Course of = driven(control, 2000, swing, [](double z, double) { return -500 * z; });
    EXPECT_EQ(of.share.back(), 1) << "a full tank";
    EXPECT_NEAR(of.level_J.back(), 1 - of.given_J(delay), 1e-12) << delay;
    // Colgate and Schenkel: K T (½ + d) ∫v² more than the spring had; six whole periods
    const double v_square = 0.5 * std::pow(0.004 * 2 * std::numbers::pi * 3, 2) * 2;
    const double theory = 500 * kControlPeriod_s * (0.5 + delay) * v_square;
    EXPECT_NEAR(of.given_J(delay), theory, 0.05 * theory + 2e-5) << delay;
  }
}

// With 2,000 fine steps per tick and the lag integrated; the handle moves evenly within a tick.
TEST(PassivityControl, countsTheWorkOfAWrenchBehindALag) {
  for (const double lag_s : {0.5e-3, 2e-3, 8e-3}) {
    PassivitySettings settings = withTank(1, 2, 2);
    settings.lag_s = lag_s;
    PassivityControl control(settings, kControlRate_hz);
    const Course of = driven(control, 1000, swing, [](double z, double) { return -500 * z; });
    constexpr int kFine = 2000;
    double given_J = 0, acting_N = 0;
    for (std::size_t k = 1; k < of.z_m.size(); ++k) {
      const double wanted_N = k >= 3 ? of.force_N[k - 3] : 0;
      for (int i = 0; i < kFine; ++i) {
        acting_N += (wanted_N - acting_N) * kControlPeriod_s / kFine / lag_s;
        given_J += acting_N * (of.z_m[k] - of.z_m[k - 1]) / kFine;
      }
    }
    EXPECT_NEAR(control.state().level_J, 1 - given_J, 2e-3 * std::abs(given_J)) << lag_s;
    EXPECT_GT(std::abs(given_J), 1e-4);
  }
}

TEST(PassivityControl, countsTorqueTimesTurn) {
  PassivityControl control(withTank(1, 2, 0), kControlRate_hz);
  for (int k = 0; k <= 100; ++k) {
    const double angle = 1e-3 * k;
    const Pose handle{{}, {std::sin(angle / 2), 0, 0, std::cos(angle / 2)}};
    control.rendered(control.limited(handle, true, {{}, {0.2, 0, 0}}, 0));
  }
  EXPECT_NEAR(control.state().level_J, 1 - 0.2 * 0.1, 1e-8);
}

// 2 N along every motion: an engine that always gives energy
TEST(PassivityControl, anActiveForceGetsOnlyTheReserve) {
  for (const std::uint32_t delay : {0u, 1u, 3u}) {
    PassivityControl control(withTank(20e-6, 0.1, delay), kControlRate_hz);
    const Course of = driven(control, 5000, swing, [](double, double v) { return v > 0 ? 2.0 : -2.0; });
    EXPECT_LT(of.given_J(delay), 0.3e-3) << delay;
    PassivityControl full(withTank(10, 20, delay), kControlRate_hz);
    EXPECT_GT(driven(full, 5000, swing, [](double, double v) { return v > 0 ? 2.0 : -2.0; }).given_J(delay),
              0.3)
        << "without it";
  }
}

TEST(PassivityControl, aForceThatTakesIsLeftAsItIs) {
  PassivityControl control(withTank(0, 0.1), kControlRate_hz);
  const Course of = driven(control, 2000, swing, [](double, double v) { return v > 0 ? -2.0 : 2.0; });
  // at the turns the earlier force still acts
  double taken_off = 0;
  for (const double share : of.share) taken_off = std::max(taken_off, 1 - share);
  EXPECT_LT(taken_off, 0.25);
  EXPECT_LT(of.given_J(1), -0.04);
}

TEST(PassivityControl, theTankHoldsAtMostItsCapacityOrReserve) {
  PassivityControl control(withTank(20e-6, 1e-3), kControlRate_hz);
  const Course of = driven(control, 1000, swing, [](double, double v) { return v > 0 ? -2.0 : 2.0; });
  EXPECT_LE(*std::max_element(of.level_J.begin(), of.level_J.end()), 1e-3);
  control.rendered(control.limited({{0, 0, of.z_m.back()}, {}}, true, {}, 0));
  EXPECT_LE(control.state().level_J, 20e-6) << "no force: nothing is stored";
}

TEST(PassivityControl, theTankAlsoHoldsWhatTheSpringsHold) {
  PassivityControl control(withTank(20e-6, 1e-3), kControlRate_hz);
  for (int k = 0; k < 400; ++k)
    control.rendered(control.limited({{0, 0, 1e-4 * k}, {}}, true, {{0, 0, -2}, {}}, 7e-3));
  EXPECT_NEAR(control.state().level_J, 8e-3, 1e-12);
  control.rendered(control.limited({{0, 0, 0.04}, {}}, true, {{0, 0, -1}, {}}, 2e-3));
  EXPECT_NEAR(control.state().level_J, 3e-3, 1e-12) << "relaxed";
}

// A step of a coarse encoder back to where the force pushes is 10 mm/s for a tick, and 1.4 mm/s over the
// window of 7 ms. The tank of 20 µJ pays the latter's 1.4 mW for the horizon of 5 ticks; of the former's 10
// mW it could pay a fifth.
TEST(PassivityControl, aStepOfTheEncoderIsNotTakenForASpeed) {
  PassivityControl control(withTank(20e-6, 20e-6), kControlRate_hz);
  const Course of = driven(
      control, 60, [](double t) { return t < 0.05 ? 0.0 : 10e-6; }, [](double, double) { return 1.0; });
  EXPECT_NEAR(of.level_J.back(), 10e-6, 1e-12) << "it is paid for";
  EXPECT_EQ(*std::min_element(of.share.begin(), of.share.end()), 1);
}

// A force that turns from taking to giving in a tick, with a tank that pays for a slow fall; then with none.
TEST(PassivityControl, changesAForceByAtMostThreeTenthsOfANewtonATickWhereTheTankPays) {
  for (const double force_N : {2.0, 4.0}) {
    PassivityControl control(withTank(20e-6, 5e-3), kControlRate_hz);
    double before_N = 0, worst_N = 0, least_share = 1;
    for (int k = 0; k < 3000; ++k) {
      const double phase = std::fmod(k * kControlPeriod_s, 0.2), z_m = phase < 0.1 ? phase : 0.2 - phase;
      const Wrench wrench = control.limited({{0, 0, 0.05 * z_m}, {}}, true,
                                            {{0, 0, phase < 0.1 ? -force_N : -force_N * 0.999}, {}}, 0);
      control.rendered(wrench);
      if (k > 0) worst_N = std::max(worst_N, std::fabs(wrench.force_N.z - before_N));
      before_N = wrench.force_N.z;
      least_share = std::min(least_share, control.state().share);
    }
    EXPECT_LT(least_share, 0.7) << "it has work to do";
    EXPECT_LT(worst_N, 0.3 + 0.001 * force_N + 1e-9) << force_N;
  }
  PassivityControl control(withTank(20e-6, 20e-6), kControlRate_hz);
  for (int k = 0; k < 12; ++k)
    control.rendered(control.limited({{0, 0, 2e-4 * k}, {}}, true, {{0, 0, 4}, {}}, 0));
  EXPECT_LT(control.state().share, 0.05) << "energy comes first";
}

TEST(PassivityControl, dampingFillsTheTankOnlyByItsDissipation) {
  PassivitySettings settings = withTank(0, 1);
  settings.damping_Ns_per_m = 1.7;
  PassivityControl control(settings, kControlRate_hz);
  // a wrench without work keeps the tank from being treated as outside
  for (int k = 0; k < 2000; ++k)
    control.rendered(control.limited({{0, 0, swing(k * kControlPeriod_s)}, {}}, true, {{1, 0, 0}, {}}, 0));
  const double lost = 1.7 * 0.5 * std::pow(0.004 * 2 * std::numbers::pi * 3, 2) * 2;
  EXPECT_LE(control.state().level_J, lost);
  EXPECT_GT(control.state().level_J, 0.95 * lost);
}

// a pressed spring whose force fades in, as in the gate
TEST(PassivityControl, countsWhatTheGateLetThrough) {
  PassivityControl control(withTank(20e-6, 0.1, 0), kControlRate_hz);
  double given_J = 0, before_m = 0, acting_N = 0;
  for (int k = 0; k <= 400; ++k) {
    const double z_m = 0.006 * std::sin(std::numbers::pi * k / 400);
    given_J += acting_N * (z_m - before_m);
    before_m = z_m;
    const Wrench limited = control.limited({{0, 0, z_m}, {}}, true, {{0, 0, -500 * z_m}, {}}, 0);
    acting_N = limited.force_N.z * std::min(1.0, k / 200.0);
    control.rendered({{0, 0, acting_N}, {}});
  }
  EXPECT_LT(given_J, 0.1e-3) << "the bare gate gives 3 mJ";
}

TEST(PassivityControl, ticksWithoutAPoseCountAtTheirWorst) {
  PassivityControl control(withTank(1, 2, 0), kControlRate_hz);
  control.rendered(control.limited({}, true, {{0, 0, 1}, {}}, 0));
  control.rendered(control.limited({}, false, {{0, 0, 3}, {}}, 0));
  control.rendered(control.limited({}, false, {{0, 0, 2}, {}}, 0));
  (void)control.limited({{0, 0, 0.01}, {}}, true, {{0, 0, 1}, {}}, 0);
  EXPECT_NEAR(control.state().level_J, 1 - 3 * 0.01, 1e-12);
}

TEST(PassivityControl, aWrenchThatIsNoNumberIsLeftToTheGate) {
  PassivityControl control(withTank(1, 2, 0), kControlRate_hz);
  control.rendered(control.limited({}, true, {{0, 0, 1}, {}}, 0));
  const PassivityState before = control.state();
  EXPECT_TRUE(std::isnan(control.limited({{0, 0, 0.01}, {}}, true, {{0, 0, std::nan("")}, {}}, 0).force_N.z));
  EXPECT_TRUE(control.state() == before);
}

TEST(PassivityControl, missedTicksRenderTheLastWrench) {
  PassivityControl control(withTank(1, 2, 1), kControlRate_hz);
  control.rendered(control.limited({}, true, {{0, 0, 1}, {}}, 0));
  control.rendered(control.limited({}, true, {{0, 0, 2}, {}}, 0));
  (void)control.limited({{0, 0, 0.01}, {}}, true, {{0, 0, 1}, {}}, 0, 50);
  EXPECT_NEAR(control.state().level_J, 1 - 2 * 0.01, 1e-12);
}

TEST(PassivityControl, sameInputsSameBitsAndNoHeap) {
  PassivityControl one(withTank(20e-6, 0.1), kControlRate_hz), other = one;
  EXPECT_TRUE(one.state() == other.state());
  const auto spring = [](double z, double v) { return -500 * z + v; };
  driven(one, 500, swing, spring);
  EXPECT_FALSE(one.state() == other.state());
  driven(other, 500, swing, spring);
  EXPECT_TRUE(one.state() == other.state());
  std::uint64_t calls = 1;
  {
    const NoAllocScope scope;
    for (int k = 0; k < 100; ++k)
      one.rendered(one.limited({{0, 0, 1e-4 * k}, {}}, k % 7 != 0, {{0, 0, 1}, {}}, 1 + k % 5));
    calls = scope.calls();
  }
  EXPECT_EQ(calls, 0u);
}

}  // namespace
}  // namespace needlelab::test
