#include "client/view/model/letters.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <utility>

namespace needlelab {
namespace {

constexpr std::array kScreens = {std::pair(1280, 720), std::pair(1920, 1080), std::pair(2560, 1440),
                                 std::pair(3840, 2160)};

TEST(Letters, aPixelHasTheAngleOfItsHeight) {
  // 24 inches at 16:9 are 531.3 mm wide; small angles equal their tangents to 1e-7
  const double pixel_mm = 24 * 25.4 * 16 / std::sqrt(16.0 * 16 + 9 * 9) / 1920;
  EXPECT_NEAR(pixel_mm, 0.2767, 1e-4);
  EXPECT_NEAR(arcminPerPixel({}, 1920, 1080), pixel_mm / 2000 * (180 * 60 / std::acos(-1.0)), 1e-6);
  EXPECT_NEAR(arcminPerPixel({}, 3840, 2160), arcminPerPixel({}, 1920, 1080) / 2, 1e-6);
  EXPECT_NEAR(arcminPerPixel({48 * kInch_m, 4}, 1920, 1080), arcminPerPixel({}, 1920, 1080), 1e-12);
}

TEST(Letters, lettersHaveTheirAnglesAndArePixelsLargeAtMost) {
  for (const Viewing& viewing : {Viewing{}, Viewing{32 * kInch_m, 3}})
    for (const auto& [width_px, height_px] : kScreens) {
      const double per_px = arcminPerPixel(viewing, width_px, height_px);
      const LetterSizes sizes = letterSizes(viewing, width_px, height_px);
      for (const auto& [size_px, least_arcmin] :
           {std::pair(sizes.figure_px, kFigureArcmin), std::pair(sizes.heading_px, kHeadingArcmin),
            std::pair(sizes.body_px, kBodyArcmin), std::pair(sizes.small_px, kSmallArcmin)}) {
        EXPECT_GE(size_px * kCapitalHeight * per_px, least_arcmin) << height_px;
        EXPECT_LT((size_px - 1) * kCapitalHeight * per_px, least_arcmin) << height_px;
        EXPECT_EQ(size_px, std::floor(size_px));
      }
    }
}

TEST(Letters, onADeskLettersScaleWithTheWindow) {
  const LetterSizes near = letterSizes({24 * kInch_m, 0.6}, 1280, 720);
  EXPECT_EQ(near, LetterSizes());
  EXPECT_EQ(letterSizes({24 * kInch_m, 0.6}, 2560, 1440).heading_px, 2 * LetterSizes().heading_px);
}

TEST(Letters, aPersonsScaleMultiplies) {
  const LetterSizes once = letterSizes({}, 1920, 1080), twice = letterSizes({}, 1920, 1080, 2);
  EXPECT_NEAR(twice.heading_px, 2 * once.heading_px, 1);
  EXPECT_NEAR(twice.small_px, 2 * once.small_px, 1);
}

TEST(Letters, headingsTakeTheSameShareOfAnyResolution) {
  EXPECT_LE(headingShare({}), kMaxHeadingShare) << "the usual station";
  for (const auto& [width_px, height_px] : kScreens)
    EXPECT_NEAR(letterSizes({}, width_px, height_px).heading_px / height_px, headingShare({}),
                1.0 / height_px);
  EXPECT_GT(headingShare({24 * kInch_m, 2.5}), kMaxHeadingShare);
}

}  // namespace
}  // namespace needlelab
