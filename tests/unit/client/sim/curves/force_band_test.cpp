// Bands of a distribution of forces, checked by formulas.
#include "client/sim/curves/force_band.h"

#include <gtest/gtest.h>

#include <cmath>

namespace needlelab {
namespace {

TEST(ForceBand, centralBandOfALogNormalForce) {
  // mean e^(1/8), sd so that µ = 0 and σ = 1/2: the band is e^(±1.96/2)
  const double mean = std::exp(0.125), sd = mean * std::sqrt(std::exp(0.25) - 1);
  const ForceBand band = centralBand95(mean, sd);
  EXPECT_NEAR(band.low_N, std::exp(-0.97998), 1e-5);
  EXPECT_NEAR(band.high_N, std::exp(0.97998), 1e-5);
}

TEST(BandVerdict, saysKeptMissedOrThatItCannotTell) {
  // Wilson's interval of 75 of 100: 65.7 to 82.5 %
  const BandVerdict narrow = bandVerdict(0.75, 100);
  EXPECT_NEAR(narrow.low, 0.657, 5e-4);
  EXPECT_NEAR(narrow.high, 0.825, 5e-4);
  EXPECT_EQ(narrow.text.find("MISSED: too narrow"), 0u) << narrow.text;
  EXPECT_EQ(bandVerdict(0.95, 100).text.find("kept"), 0u);
  EXPECT_EQ(bandVerdict(1, 200).text.find("MISSED: too wide"), 0u);
  EXPECT_EQ(bandVerdict(0.8, 5).text.find("cannot tell"), 0u);
  EXPECT_EQ(bandVerdict(0, 0).text.find("cannot tell"), 0u);
}

}  // namespace
}  // namespace needlelab
