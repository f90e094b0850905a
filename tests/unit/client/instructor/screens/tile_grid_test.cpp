#include "client/instructor/screens/tile_grid.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

constexpr float kGap = 5, kLeastWidth = 160, kLeastHeight = 90;

TileGrid gridOf(int count, float width_px, float height_px) {
  return tileGrid(count, width_px, height_px, kGap, kLeastWidth, kLeastHeight);
}

TEST(TileGrid, fillsTheRoomWithEveryCountThatFits) {
  for (int count = 1; count <= 50; ++count) {
    const TileGrid grid = gridOf(count, 1600, 980);
    EXPECT_FALSE(grid.scrolls) << count;
    EXPECT_GE(grid.columns * grid.rows, count);
    EXPECT_LT(grid.columns * (grid.rows - 1), count) << "no empty row";
    EXPECT_NEAR(grid.width_px * grid.columns + kGap * (grid.columns - 1), 1600, 0.1);
    EXPECT_NEAR(grid.height_px * grid.rows + kGap * (grid.rows - 1), 980, 0.1);
    EXPECT_GE(grid.width_px, kLeastWidth);
    EXPECT_GE(grid.height_px, kLeastHeight);
  }
  EXPECT_EQ(gridOf(16, 1600, 980).columns, 4);
}

TEST(TileGrid, scrollsWhereTilesWouldBecomeTooSmallToRead) {
  const TileGrid grid = gridOf(200, 1600, 980);
  EXPECT_TRUE(grid.scrolls);
  EXPECT_EQ(grid.columns, 9) << "1,600 px hold nine of 160 and a gap";
  EXPECT_EQ(grid.height_px, kLeastHeight);
  EXPECT_EQ(gridOf(5, 100, 80).columns, 1) << "a window narrower than a tile";
}

}  // namespace
}  // namespace needlelab
