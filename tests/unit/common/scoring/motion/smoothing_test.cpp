#include "common/scoring/motion/smoothing.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <random>

namespace needlelab {
namespace {

/// The value `i` places from the first, possibly outside: reflected step by step until inside.
double steppedTo(const std::vector<double>& values, std::ptrdiff_t i) {
  const auto count = static_cast<std::ptrdiff_t>(values.size());
  double offset = 0, sign = 1;
  while (i < 0 || i >= count) {
    const std::ptrdiff_t end = i < 0 ? 0 : count - 1;
    offset += sign * 2 * values[static_cast<std::size_t>(end)];
    sign = -sign;
    i = 2 * end - i;
  }
  return offset + sign * values[static_cast<std::size_t>(i)];
}

std::vector<double> someValues(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0.1, 0.03);
  std::vector<double> values(count);
  for (double& v : values) v = normal(random);
  return values;
}

TEST(Reflected, isBitForBitWhatStepByStepReflectionGives) {
  for (std::size_t count = 2; count <= 20; ++count) {
    const std::vector<double> values = someValues(count, count);
    for (const std::size_t reach : {std::size_t{0}, std::size_t{1}, count - 1, count, std::size_t{400}}) {
      const std::vector<double> all = reflected(values, reach);
      ASSERT_EQ(all.size(), count + 2 * reach);
      for (std::size_t place = 0; place < all.size(); ++place) {
        const auto i = static_cast<std::ptrdiff_t>(place) - static_cast<std::ptrdiff_t>(reach);
        ASSERT_EQ(std::bit_cast<std::uint64_t>(all[place]),
                  std::bit_cast<std::uint64_t>(steppedTo(values, i)))
            << count << " values, place " << i << " of reach " << reach;
      }
    }
  }
}

TEST(Reflected, aSingleValueGoesOnAndNothingStaysNothing) {
  EXPECT_EQ(reflected(std::vector<double>{0.25}, 3), std::vector<double>(7, 0.25));
  EXPECT_TRUE(reflected(std::vector<double>{}, 3).empty());
}

TEST(Smoothing, isBitForBitTheSumOverStepByStepReflections) {
  for (const std::size_t count : {2u, 3u, 7u, 20u}) {
    const std::vector<double> values = someValues(count, 100 + count);
    const std::vector<double> half = someValues(60, 7);
    const std::vector<double> smooth = smoothed(values, half);
    ASSERT_EQ(smooth.size(), count);
    for (std::size_t i = 0; i < count; ++i) {
      const auto at = static_cast<std::ptrdiff_t>(i);
      double sum = half[0] * values[i];
      for (std::ptrdiff_t k = 1; k < 60; ++k)
        sum += half[static_cast<std::size_t>(k)] * (steppedTo(values, at - k) + steppedTo(values, at + k));
      EXPECT_EQ(std::bit_cast<std::uint64_t>(smooth[i]), std::bit_cast<std::uint64_t>(sum)) << count;
    }
  }
}

/// A number that counts its operations.
struct Counted {
  Counted() = default;
  explicit Counted(double of) : value(of) {}
  double value = 0;
  static inline std::size_t operations = 0;
};
Counted operator+(Counted a, Counted b) {
  ++Counted::operations;
  return Counted(a.value + b.value);
}
Counted operator*(Counted a, Counted b) {
  ++Counted::operations;
  return Counted(a.value * b.value);
}
Counted operator-(Counted a) {
  return Counted(-a.value);
}

TEST(Smoothing, theWorkGrowsWithPointsTimesKernelAndNotWithReflections) {
  // two ticks at 40 kHz: a kernel of some 3,500 points over a signal of two points
  for (const std::size_t count : {2u, 3u, 11u, 100u}) {
    for (const std::size_t reach : {9u, 89u, 3534u}) {
      const std::vector<Counted> values(count, Counted(0.5)), half(reach + 1, Counted(0.01));
      Counted::operations = 0;
      (void)smoothed(values, half);
      const std::size_t reflections = 2 * ((reach + count - 2) / (count - 1));
      EXPECT_EQ(Counted::operations, 2 * (count + 2 * reach) + 3 * reflections + count * (1 + 3 * reach))
          << count << " values, reach " << reach;
    }
  }
}

}  // namespace
}  // namespace needlelab
