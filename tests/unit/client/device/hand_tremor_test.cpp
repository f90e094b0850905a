#include "client/device/hand_tremor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

namespace needlelab {
namespace {

constexpr double kStep = 1.0 / 20'000;

TEST(HandRandom, isTheSameEverywhere) {
  // SplitMix64 with seed 1234567: the values of the published definition
  HandRandom random(1234567);
  EXPECT_EQ(random.next(), 6457827717110365317u);
  EXPECT_EQ(random.next(), 3203168211198807973u);
  EXPECT_EQ(random.next(), 9817491932198370423u);
  double least = 1, greatest = 0, sum = 0;
  for (int i = 0; i < 100'000; ++i) {
    const double u = random.uniform();
    least = std::min(least, u), greatest = std::max(greatest, u), sum += u;
  }
  EXPECT_GE(least, 0);
  EXPECT_LT(greatest, 1);
  EXPECT_NEAR(sum / 100'000, 0.5, 0.005);
}

TEST(HandTremor, staysWithinItsAmplitudeAndUsesIt) {
  for (const double amplitude : {25e-6, 50e-6, 250e-6}) {
    HandTremor tremor(amplitude, 7, kStep);
    double peak[3] = {0, 0, 0}, square = 0;
    const int n = 60 * 20'000;
    for (int i = 0; i < n; ++i) {
      const Vec3 d = tremor.next();
      peak[0] = std::max(peak[0], std::abs(d.x));
      peak[1] = std::max(peak[1], std::abs(d.y));
      peak[2] = std::max(peak[2], std::abs(d.z));
      square += normSquared(d);
    }
    for (const double p : peak) {
      EXPECT_LE(p, amplitude * (1 + 1e-9));
      EXPECT_GE(p, 0.9 * amplitude);
    }
    // three sines of a third of the amplitude in each of three axes: mean square A²/2 in all
    EXPECT_NEAR(square / n, amplitude * amplitude / 2, 0.02 * amplitude * amplitude);
  }
}

// the phase of each sine after 10 minutes is what its frequency says: nothing drifts, nothing grows
TEST(HandTremor, isTheSumOfSinesInTheBand) {
  const double amplitude = 1;
  HandTremor tremor(amplitude, 99, kStep);
  // fit the known frequencies to the first second and to the last: same amplitudes of a third
  std::vector<double> x;
  const int n = 20'000 * 60;
  x.reserve(n);
  for (int i = 0; i < n; ++i) x.push_back(tremor.next().x);
  double explained = 0;
  for (std::size_t partial = 0; partial < HandTremor::kPartials; ++partial) {
    const double hz = tremor.frequencyHz(0, partial);
    EXPECT_GE(hz, 8);
    EXPECT_LE(hz, 12);
    double c = 0, s = 0;
    for (int i = 0; i < n; ++i) {
      const double a = 2 * M_PI * hz * i * kStep;
      c += x[static_cast<std::size_t>(i)] * std::cos(a);
      s += x[static_cast<std::size_t>(i)] * std::sin(a);
    }
    const double found = 2 * std::hypot(c, s) / n;
    EXPECT_NEAR(found, 1.0 / 3, 0.02);
    explained += found * found / 2;
  }
  double square = 0;
  for (const double v : x) square += v * v;
  EXPECT_NEAR(square / n, explained, 0.01);  // and there is nothing beside them
}

TEST(HandTremor, dependsOnItsSeedOnly) {
  HandTremor a(50e-6, 1, kStep), b(50e-6, 1, kStep), c(50e-6, 2, kStep);
  std::uint64_t hash = 14695981039346656037u;
  bool differs = false;
  for (int i = 0; i < 20'000; ++i) {
    const Vec3 pa = a.next();
    EXPECT_EQ(pa, b.next());
    differs = differs || pa != c.next();
    for (const double v : {pa.x, pa.y, pa.z}) {
      std::uint64_t bits = 0;
      std::memcpy(&bits, &v, sizeof bits);
      hash = (hash ^ bits) * 1099511628211u;
    }
  }
  EXPECT_TRUE(differs);
  EXPECT_EQ(hash, 5944133999550495048u) << "the bits of a seed's hand have changed";
}

TEST(HandTremor, noAmplitudeMeansNoMotion) {
  HandTremor tremor(0, 1, kStep);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(tremor.next(), Vec3{});
}

}  // namespace
}  // namespace needlelab
