/// A section: against the field at each of its points.
#include "common/anatomy/field_section.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/anatomy/fields.h"

namespace needlelab::test {
namespace {

TEST(FieldSection, hasTheFieldsStructureAtEachPoint) {
  const Field field = fieldOf(forearm());
  // across the arm, and obliquely; the sizes are no multiples of a tile
  for (const SectionFrame& frame : {SectionFrame{mm(-20, -40, -45), mm(0, 80, 0), mm(0, 0, 50), 203, 131},
                                    SectionFrame{mm(-50, -30, -40), mm(80, 60, 0), mm(0, 0, 45), 190, 77}}) {
    const FieldSection section = sectionOf(field, frame);
    for (int y = 0; y < frame.height; ++y)
      for (int x = 0; x < frame.width; ++x)
        ASSERT_EQ(section.at(x, y), field.at(frame.at(x + 0.5, y + 0.5)).structure) << x << ", " << y;
  }
}

TEST(FieldSection, namesAStructureNearTheWatchedPlaceNotAtItsFarEnd) {
  // a slab of fat is as wide everywhere: the name is under the watched place
  const Field field = fieldOf(slab());
  const SectionFrame frame{mm(-50, 0, -20), mm(100, 0, 0), mm(0, 0, 25), 400, 100};
  for (const double x_mm : {-30.0, 0.0, 25.0}) {
    const FieldSection section = sectionOf(field, frame, mm(x_mm, 0, 0));
    for (const FieldSection::Place& place : section.places)
      EXPECT_NEAR(frame.at(place.x, place.y).x, x_mm * 1e-3, 9e-3) << field.structures()[place.structure].id;
  }
}

TEST(FieldSection, namesEachStructureAtAPlaceFarFromItsBounds) {
  const Field field = fieldOf(forearm());
  const SectionFrame frame{mm(-20, -40, -45), mm(0, 80, 0), mm(0, 0, 50), 400, 250};
  const FieldSection section = sectionOf(field, frame);
  std::vector<bool> named(field.structures().size(), false);
  for (const FieldSection::Place& place : section.places) {
    const FieldPoint there = field.at(frame.at(place.x, place.y));
    EXPECT_EQ(there.structure, place.structure);
    EXPECT_EQ(there.clearance_m, place.clearance_m);
    named[place.structure] = true;
  }
  for (const StructureIndex here : section.structures)
    if (here != kOutside) {
      ASSERT_TRUE(named[here]);
    }
}

}  // namespace
}  // namespace needlelab::test
