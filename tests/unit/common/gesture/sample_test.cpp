#include "common/gesture/sample.h"

#include <gtest/gtest.h>

#include <limits>

namespace needlelab {
namespace {

TEST(Sample, standardAndLosslessResolutionsAreValid) {
  EXPECT_TRUE(validate(Resolution::standard()).ok());
  EXPECT_TRUE(validate(Resolution::lossless()).ok());
  EXPECT_EQ(Resolution::standard().quaternion * 32768, 1.0);
}

TEST(Sample, aBadStepOfItsResolutionIsNamedWithValueAndRange) {
  Resolution r;
  for (const double bad : {-1e-6, 1.5, 1e-13, std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity()}) {
    r.torque_Nm = bad;
    const Status status = validate(r);
    ASSERT_FALSE(status.ok()) << bad;
    EXPECT_EQ(status.error().code, ErrorCode::kInvalidInput);
    EXPECT_NE(status.error().message.find("torque_Nm"), std::string::npos);
    EXPECT_NE(status.error().message.find("1e-12 to 1"), std::string::npos);
  }
}

}  // namespace
}  // namespace needlelab
