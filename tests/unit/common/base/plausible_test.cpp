#include "common/base/plausible.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace needlelab {
namespace {

using ::testing::HasSubstr;

TEST(Plausible, theLikelyUnitIsTheOneWhoseValueIsUsual) {
  const struct {
    Quantity quantity;
    double value;
    const char* said;
  } cases[] = {
      {Quantity::kTool, 130, "looks like millimetres: 130 millimetres are 0.13 m"},
      {Quantity::kTool, 13, "looks like centimetres: 13 centimetres are 0.13 m"},
      {Quantity::kTool, -5.6, "looks like inches: -5.6 inches are -0.14224 m"},
      {Quantity::kPlacement, 20, "looks like millimetres: 20 millimetres are 0.02 m"},
      {Quantity::kWay, 40, "looks like millimetres: 40 millimetres are 0.04 m"},
      {Quantity::kWay, 4, "looks like centimetres: 4 centimetres are 0.04 m"},
      {Quantity::kStep, 16.7, "looks like milliseconds: 16.7 milliseconds are 0.0167 s"},
      {Quantity::kStep, 1e7, "looks like nanoseconds: 1e+07 nanoseconds are 0.01 s"},
      {Quantity::kSpeed, 300, "looks like millimetres a minute: 300 millimetres a minute are 0.005 m/s"},
      {Quantity::kForce, 36, "looks like gram-force: 36 gram-force are 0.353039 N"},
      {Quantity::kForce, 900, "looks like millinewtons: 900 millinewtons are 0.9 N"},
      {Quantity::kDiameter, 1.27, "looks like millimetres: 1.27 millimetres are 0.00127 m"},
      {Quantity::kShare, 50, "looks like percent: 50 percent are 0.5"}};
  for (const auto& one : cases) EXPECT_THAT(implausible(one.quantity, one.value), HasSubstr(one.said));
}

TEST(Plausible, whatNeedlesAndHandsDoIsNotNamed) {
  EXPECT_EQ(implausible(Quantity::kTool, 0.9), "");
  EXPECT_EQ(implausible(Quantity::kWay, 0.3), "");
  EXPECT_EQ(implausible(Quantity::kForce, -15), "");
  EXPECT_EQ(implausible(Quantity::kDepth, 0.12), "");
}

TEST(Plausible, aFewPosesOfAPlanMayBeFarApart) {
  std::vector<double> t_s;
  for (int i = 0; i < 49; ++i) t_s.push_back(10.0 * i);
  EXPECT_TRUE(checkTimeStep("f.csv", t_s).ok());
  t_s.push_back(490);
  EXPECT_THAT(checkTimeStep("f.csv", t_s).error().message,
              HasSubstr("f.csv: the usual step between rows is 10 s"));
}

}  // namespace
}  // namespace needlelab
