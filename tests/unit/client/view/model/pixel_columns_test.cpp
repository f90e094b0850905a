#include "client/view/model/pixel_columns.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

namespace needlelab {
namespace {

TEST(PixelColumns, keepLeastGreatestAndLastOfTheirTime) {
  const std::vector<double> x = {0.0, 0.2, 0.4, 1.1, 2.5}, y = {3, 9, 1, 5, 7};
  std::vector<PixelColumn> columns(3);
  fillColumns(x, y, 0, 3, columns);
  EXPECT_FLOAT_EQ(columns[0].min, 1);
  EXPECT_FLOAT_EQ(columns[0].max, 9);
  EXPECT_FLOAT_EQ(columns[0].last, 1);
  EXPECT_FLOAT_EQ(columns[1].last, 5);
  EXPECT_FLOAT_EQ(columns[2].last, 7);
}

TEST(PixelColumns, leaveOutWhatIsNotFiniteOrOutside) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> x = {-1, 0.5, 1.5, 3}, y = {100, nan, 2, 100};
  std::vector<PixelColumn> columns(2);
  fillColumns(x, y, 0, 2, columns);
  EXPECT_TRUE(columns[0].empty());
  EXPECT_FLOAT_EQ(columns[1].max, 2);
}

TEST(PixelColumns, ofNoRangeOrNoColumnsAreEmpty) {
  const std::vector<double> x = {0, 1}, y = {1, 1};
  std::vector<PixelColumn> columns(2);
  columns[0].take(4);
  fillColumns(x, y, 1, 1, columns);
  EXPECT_TRUE(columns[0].empty() && columns[1].empty());
  fillColumns(x, y, 0, 1, {});
}

TEST(PixelColumns, aLoneSpikeIsNeverLost) {
  std::vector<double> x, y;
  for (int i = 0; i < 100000; ++i) {
    x.push_back(i * 0.001);
    y.push_back(i == 54321 ? 42 : 0);
  }
  std::vector<PixelColumn> columns(300);
  columnsOf(x, y)(0, 100, columns);
  float greatest = 0;
  for (const PixelColumn& column : columns) greatest = std::max(greatest, column.max);
  EXPECT_FLOAT_EQ(greatest, 42);
}

}  // namespace
}  // namespace needlelab
