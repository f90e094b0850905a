#include "common/scoring/smoothness.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace needlelab {
namespace {

/// exp(−5 t²) over [−1, 1) at 100 Hz: the published example's speed profile.
std::vector<double> bell(double height = 1) {
  std::vector<double> speed;
  for (int i = 0; i < 200; ++i) speed.push_back(height * std::exp(-5 * std::pow(-1 + i / 100.0, 2)));
  return speed;
}

TEST(Smoothness, hasTheReferenceValues) {
  EXPECT_NEAR(*sparc(bell(), 100), -1.41403, 5e-6);
  EXPECT_NEAR(*ldlj(bell(), 100), -5.81636, 5e-6);
}

TEST(Smoothness, doesNotDependOnHowFastThePersonIs) {
  // ten times the speed: both are without a unit
  EXPECT_NEAR(*sparc(bell(10), 100), *sparc(bell(), 100), 1e-12);
  EXPECT_NEAR(*ldlj(bell(10), 100), *ldlj(bell(), 100), 1e-12);
  // the same shape over twice the time: LDLJ does not change, SPARC's normalised width does but little
  EXPECT_NEAR(*ldlj(bell(), 50), *ldlj(bell(), 100), 1e-12);
}

TEST(Smoothness, twoMovementsAreLessSmoothThanOne) {
  std::vector<double> two = bell();
  const std::vector<double> again = bell();
  two.insert(two.end(), again.begin(), again.end());
  EXPECT_LT(*sparc(two, 100), *sparc(bell(), 100) - 0.1);
  EXPECT_LT(*ldlj(two, 100), *ldlj(bell(), 100) - 1);
}

TEST(Smoothness, sparcAgreesWithASpectrumSummedTermByTerm) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::vector<double> speed(37);  // not a power of two
  for (double& v : speed) v = std::abs(normal(random));
  const std::size_t length = 64u << kSparcPadding;
  std::vector<double> amplitude;
  for (std::size_t k = 0; static_cast<double>(k) * 100 / static_cast<double>(length) <= kSparcCutoffHz; ++k) {
    double re = 0, im = 0;
    for (std::size_t n = 0; n < speed.size(); ++n) {
      const double angle = 2 * std::numbers::pi * static_cast<double>(k * n) / static_cast<double>(length);
      re += speed[n] * std::cos(angle);
      im -= speed[n] * std::sin(angle);
    }
    amplitude.push_back(std::hypot(re, im));
  }
  const double top = *std::max_element(amplitude.begin(), amplitude.end());
  std::size_t first = 0, last = amplitude.size() - 1;
  while (amplitude[first] < kSparcThreshold * top) ++first;
  while (amplitude[last] < kSparcThreshold * top) --last;
  double arc = 0;
  for (std::size_t i = first; i < last; ++i) {
    arc -= std::hypot(1.0 / static_cast<double>(last - first), (amplitude[i + 1] - amplitude[i]) / top);
  }
  EXPECT_NEAR(*sparc(speed, 100), arc, 1e-10);
}

TEST(Smoothness, saysNothingWithoutMovement) {
  const std::vector<double> rest(100, 0.0), two(2, 1.0), constant(100, 1.0);
  for (const auto& speed : {std::vector<double>{}, rest, two}) {
    EXPECT_FALSE(sparc(speed, 100).has_value());
    EXPECT_FALSE(ldlj(speed, 100).has_value());
  }
  EXPECT_FALSE(ldlj(constant, 100).has_value()) << "no jerk at all has no logarithm";
  EXPECT_TRUE(sparc(constant, 100).has_value());
  EXPECT_FALSE(sparc(std::vector<double>(kLongestProfile + 1, 1.0), 100).has_value());
}

}  // namespace
}  // namespace needlelab
