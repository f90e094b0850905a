#include "client/instructor/model/live/depth_picture.h"

#include <gtest/gtest.h>

#include "common/profile/profile.h"
#include "tests/unit/client/instructor/model/lesson_gestures.h"

namespace needlelab {
namespace {

TEST(DepthPicture, hasTheLayersOfAShellFromTheSkinOn) {
  const std::string json = test::sampleProfile("shoulder-adult");
  const auto picture = depthPictureOf(test::lessonInfo(json).description(), nullptr);
  ASSERT_TRUE(picture.ok()) << picture.error().message;
  const auto profile = parseProfile(json, "test");
  ASSERT_TRUE(profile.ok());
  double top_m = 0;
  for (std::size_t i = 0; i < picture->bands.size(); ++i) {
    // straight in, a layer is as long as it is thick; the way is looked at every 0.1 mm
    EXPECT_NEAR(picture->bands[i].top_m, top_m, 1.1e-4) << i;
    top_m += profile->layers(static_cast<int>(i)).thickness_m();
  }
  EXPECT_NEAR(picture->bands.back().bottom_m, picture->depth_m, 1.1e-4);
  ASSERT_EQ(picture->targets.size(), 1U);
  EXPECT_GT(picture->depth_m, picture->targets[0].bottom_m);
}

TEST(DepthPicture, thatCannotBeReadIsAnError) {
  EXPECT_FALSE(depthPictureOf(test::lessonInfo("{}").description(), nullptr).ok());
}

}  // namespace
}  // namespace needlelab
