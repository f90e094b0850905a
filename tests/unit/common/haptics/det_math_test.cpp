// Our elementary functions (common/haptics/det_math.h) compared with the C library's.
#include "common/haptics/det_math.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>

#include "tests/support/random.h"

namespace needlelab::test {
namespace {

// distance in ulps of `expected`
double ulps(double value, double expected) {
  if (value == expected) return 0;
  const double unit = std::nextafter(std::abs(expected), HUGE_VAL) - std::abs(expected);
  return std::abs(value - expected) / unit;
}

// values spread over magnitudes as well as evenly
double spread(Random& random, double most) {
  const double even = random.in(-most, most);
  return random.chance(0.5) ? even : even * std::ldexp(1.0, -static_cast<int>(random.below(60)));
}

constexpr int kTries = 100'000;

TEST(DetMath, atan2IsWithinThreeUnitsOfTheLibrary) {
  Random random(1);
  for (int i = 0; i < kTries; ++i) {
    const double y = spread(random, 2), x = spread(random, 2);
    ASSERT_LE(ulps(detAtan2(y, x), std::atan2(y, x)), 3.0) << y << " " << x;
  }
}

TEST(DetMath, atan2OnTheAxesAndSigns) {
  const double pi = kPi;
  EXPECT_EQ(detAtan2(0.0, 0.0), 0.0);
  EXPECT_EQ(detAtan2(0.0, 1.0), 0.0);
  EXPECT_EQ(detAtan2(1.0, 0.0), pi / 2);
  EXPECT_EQ(detAtan2(-1.0, 0.0), -pi / 2);
  EXPECT_EQ(detAtan2(0.0, -1.0), pi);
  EXPECT_EQ(detAtan2(1.0, 1.0), pi / 4);
  EXPECT_EQ(detAtan2(-1.0, 1.0), -pi / 4);
  EXPECT_NEAR(detAtan2(1.0, -1.0), 3 * pi / 4, 1e-15);
  EXPECT_EQ(detAtan2(1e-300, 1.0), 1e-300);
  EXPECT_EQ(detAtan(1.0), pi / 4);
}

TEST(DetMath, atanIsMonotoneAcrossItsTable) {
  double before = detAtan(0.0);
  for (int i = 1; i <= 200'000; ++i) {
    const double now = detAtan(i * 1e-5);
    ASSERT_GE(now, before - 2e-16) << i;
    before = now;
  }
}

TEST(DetMath, asinIsWithinThreeUnitsAndHeldToItsDomain) {
  Random random(2);
  for (int i = 0; i < kTries; ++i) {
    const double x = spread(random, 1);
    ASSERT_LE(ulps(detAsin(x), std::asin(x)), 3.0) << x;
  }
  EXPECT_EQ(detAsin(1.0), kPi / 2);
  EXPECT_EQ(detAsin(-1.0), -kPi / 2);
  EXPECT_EQ(detAsin(1.0000001), kPi / 2);
  EXPECT_EQ(detAsin(-2.0), -kPi / 2);
}

TEST(DetMath, sineAndCosineAgreeWithTheLibrary) {
  Random random(3);
  for (int i = 0; i < kTries; ++i) {
    const double x = spread(random, 10);
    // near a zero of the function an ulp is tiny: absolute there, relative elsewhere
    ASSERT_NEAR(detSin(x), std::sin(x), 4e-16) << x;
    ASSERT_NEAR(detCos(x), std::cos(x), 4e-16) << x;
    if (std::abs(x) < 0.7) {
      ASSERT_LE(ulps(detSin(x), std::sin(x)), 2.0) << x;
    }
  }
  for (int i = 0; i < 1000; ++i) {
    const double x = random.in(-1e5, 1e5);
    ASSERT_NEAR(detSin(x), std::sin(x), 1e-12) << x;
    ASSERT_NEAR(detCos(x), std::cos(x), 1e-12) << x;
  }
  EXPECT_EQ(detSin(0.0), 0.0);
  EXPECT_EQ(detCos(0.0), 1.0);
}

TEST(DetMath, expIsWithinThreeUnitsAndHasItsLimits) {
  Random random(4);
  for (int i = 0; i < kTries; ++i) {
    const double x = spread(random, 700);
    ASSERT_LE(ulps(detExp(x), std::exp(x)), 3.0) << x;
  }
  EXPECT_EQ(detExp(0.0), 1.0);
  EXPECT_EQ(detExp(-1e6), 0.0);
  EXPECT_EQ(detExp(1e6), std::numeric_limits<double>::infinity());
  EXPECT_EQ(detExp(-std::numeric_limits<double>::infinity()), 0.0);
  EXPECT_TRUE(std::isnan(detExp(std::numeric_limits<double>::quiet_NaN())));
}

// the bits themselves: a compiler, option or processor that changes one of them breaks replay
TEST(DetMath, bitsArePinned) {
  const auto bits = [](double value) { return std::bit_cast<std::uint64_t>(value); };
  std::uint64_t hash = 0xCBF29CE484222325ull;
  Random random(5);
  for (int i = 0; i < 20'000; ++i) {
    const double a = random.in(-3, 3), b = random.in(-3, 3);
    for (const double value : {detAtan2(a, b), detAsin(a / 3), detSin(a), detCos(b), detExp(a * b)})
      hash = (hash ^ bits(value)) * 0x100000001B3ull;
  }
  EXPECT_EQ(hash, 0x368575b414e87ac1ull) << std::hex << hash;
}

}  // namespace
}  // namespace needlelab::test
