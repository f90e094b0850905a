#include <gmock/gmock.h>

#include "client/view/scene/label_places.h"

namespace needlelab {
namespace {

using testing::ElementsAre;

TEST(SideLabels, standAtTheirBandsWhereThereIsRoom) {
  const SideLabel labels[] = {{50, 20, 100}, {150, 40, 100}};
  EXPECT_THAT(placeLabels(labels, 0, 200), ElementsAre(40, 130));
}

TEST(SideLabels, giveWayInOrderWithoutOverlapWithinTheRoom) {
  // three thin bands close together near the end, and one at the begin
  const SideLabel labels[] = {{2, 20, 4}, {90, 20, 2}, {92, 20, 2}, {94, 20, 2}};
  EXPECT_THAT(placeLabels(labels, 0, 100), ElementsAre(0, 40, 60, 80));
}

TEST(SideLabels, theThinnestAreOmittedFirstAndTheKeptOnesLast) {
  const SideLabel labels[] = {{10, 20, 1, true}, {12, 20, 5}, {20, 20, 3}, {30, 20, 9}};
  EXPECT_THAT(placeLabels(labels, 0, 60), ElementsAre(0, 20, -1, 40));
  EXPECT_THAT(placeLabels(labels, 0, 25), ElementsAre(0, -1, -1, -1));
}

}  // namespace
}  // namespace needlelab
