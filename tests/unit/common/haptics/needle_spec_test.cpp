#include "common/haptics/needle_spec.h"

#include <gtest/gtest.h>

#include <cmath>

namespace needlelab {
namespace {

TEST(NeedleSpec, gaugesHaveTheirMetricSizes) {
  EXPECT_EQ(gaugeDiameter_m(10), 0.0034);
  EXPECT_EQ(gaugeDiameter_m(16), 0.0016);
  EXPECT_EQ(gaugeDiameter_m(18), 0.0012);
  EXPECT_EQ(gaugeDiameter_m(21), 0.0008) << "bit for bit what a profile's 0.0008 is";
  EXPECT_EQ(gaugeDiameter_m(22), 0.0007);
  EXPECT_EQ(gaugeDiameter_m(25), 0.0005);
  EXPECT_EQ(gaugeDiameter_m(30), 0.0003);
  EXPECT_EQ(gaugeDiameter_m(34), 0.00018);
  for (const int none : {-1, 0, 9, 35, 1000}) EXPECT_EQ(gaugeDiameter_m(none), 0);
}

TEST(NeedleSpec, aThickerGaugeHasASmallerNumberAndNoDiameterFitsTwo) {
  for (int gauge = kThickestGauge; gauge < kThinnestGauge; ++gauge) {
    const double thick = gaugeDiameter_m(gauge), thin = gaugeDiameter_m(gauge + 1);
    EXPECT_GT(thick, thin) << gauge;
    EXPECT_GT(thick - thin, 0.075 * thick) << gauge;
  }
}

TEST(NeedleSpec, theOpeningIsHalfABevelBehindTheTip) {
  const NeedleSpec needle{0.05, 0.0007, NeedleTip::kHypodermic, 0.2};
  // the ellipse that the bevel cuts out of the tube is d/tan β long along the axis; its centre is at half of
  // that
  EXPECT_NEAR(bevelLength_m(needle), 0.0007 * std::cos(0.2) / std::sin(0.2), 1e-12);
  EXPECT_NEAR(openingBehindTip_m(needle), 0.00035 * std::cos(0.2) / std::sin(0.2), 1e-12);
}

TEST(NeedleSpec, aPencilPointOpensBehindItsCone) {
  const NeedleSpec needle{0.09, 0.0005, NeedleTip::kPencilPoint, 0.2};
  const double cone = 0.00025 * std::cos(0.2) / std::sin(0.2);
  EXPECT_NEAR(bevelLength_m(needle), cone, 1e-12);
  EXPECT_NEAR(openingBehindTip_m(needle), cone + 0.0005, 1e-12);
}

TEST(NeedleSpec, everyTipHasAUsualAngle) {
  for (const auto tip :
       {NeedleTip::kHypodermic, NeedleTip::kQuincke, NeedleTip::kTuohy, NeedleTip::kPencilPoint}) {
    const NeedleSpec needle{0.05, 0.0007, tip, 0};
    EXPECT_GT(bevelAngle_rad(needle), 0.1);
    EXPECT_LT(bevelAngle_rad(needle), 0.5);
    EXPECT_GT(openingBehindTip_m(needle), 0.0005);
    EXPECT_LT(openingBehindTip_m(needle), 0.004);
  }
  // 22G hypodermic, 11°: 1.8 mm
  EXPECT_NEAR(openingBehindTip_m({0.05, 0.0007, NeedleTip::kHypodermic, 0}), 1.8006e-3, 1e-6);
}

TEST(NeedleSpec, whatIsNotKnownPlacesTheOpeningAtTheTip) {
  EXPECT_EQ(openingBehindTip_m({}), 0);
  EXPECT_EQ(openingBehindTip_m({0.05, 0.0007, NeedleTip::kUnknown, 0}), 0);
  EXPECT_EQ(openingBehindTip_m({0.05, 0, NeedleTip::kTuohy, 0.3}), 0);
  EXPECT_EQ(openingBehindTip_m({0.05, 0, NeedleTip::kPencilPoint, 0.3}), 0);
  // an angle without a kind of tip is a bevel's
  EXPECT_GT(openingBehindTip_m({0.05, 0.0007, NeedleTip::kUnknown, 0.2}), 0);
}

}  // namespace
}  // namespace needlelab
