#include "common/base/units.h"

#include <gtest/gtest.h>

#include <cmath>

namespace needlelab {
namespace {

TEST(Units, aHalfTurnIs180DegreesBothWays) {
  EXPECT_DOUBLE_EQ(radOf(180), std::acos(-1.0));
  EXPECT_DOUBLE_EQ(degreesOf(std::acos(-1.0)), 180);
  for (const double degrees : {-135.0, 0.0, 1e-6, 40.0}) EXPECT_DOUBLE_EQ(degreesOf(radOf(degrees)), degrees);
}

TEST(Units, eachQuantityHasOneShownUnit) {
  struct Row {
    const char *unit, *shown;
    double si, value;
  };
  for (const Row& row :
       {Row{"m", "mm", 0.0023, 2.3}, Row{"m/s", "mm/s", 0.02, 20}, Row{"m^2", "cm²", 1.5e-4, 1.5},
        Row{"J", "mJ", 0.0061, 6.1}, Row{"rad", "°", std::acos(-1.0) / 18, 10}}) {
    const ShownUnit shown = shownUnitOf(row.unit);
    EXPECT_EQ(shown.name, row.shown);
    EXPECT_NEAR(row.si * shown.per_si, row.value, 1e-12) << row.unit;
  }
}

TEST(Units, otherUnitsAreShownAsTheyAre) {
  for (const char* unit : {"N", "s", "", "N/m", "M"}) {
    EXPECT_EQ(shownUnitOf(unit).name, unit);
    EXPECT_EQ(shownUnitOf(unit).per_si, 1) << unit;
  }
}

}  // namespace
}  // namespace needlelab
