#include "server/live/station_closes.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace needlelab {
namespace {

TEST(StationCloses, aStationHasItsMostAndAnotherHasAsMany) {
  StationCloses closes(3);
  std::vector<StationCloses::Place> bench, cabin;
  for (int n = 0; n < 3; ++n) {
    bench.push_back(closes.take("bench"));
    cabin.push_back(closes.take("cabin"));
    EXPECT_NE(bench.back(), nullptr);
    EXPECT_NE(cabin.back(), nullptr);
  }
  EXPECT_EQ(closes.take("bench"), nullptr);
  bench.pop_back();
  StationCloses::Place moved = std::move(bench.back());
  bench.back() = closes.take("bench");
  EXPECT_NE(bench.back(), nullptr);
  EXPECT_EQ(closes.take("bench"), nullptr) << "the moved place is still taken";
  moved.reset();
  EXPECT_NE(closes.take("bench"), nullptr);
}

TEST(StationCloses, aStationThatHasClosedAllIsForgottenAndPlacesMayEndLast) {
  StationCloses::Place last;
  {
    StationCloses closes(1);
    { const auto place = closes.take("bench"); }
    EXPECT_EQ(closes.stations(), 0u);
    last = closes.take("bench");
    EXPECT_EQ(closes.stations(), 1u);
  }
  last.reset();
}

TEST(StationCloses, withoutAPlaceAStationIsNotRemembered) {
  StationCloses closes(0);
  EXPECT_EQ(closes.take("bench"), nullptr);
  EXPECT_EQ(closes.stations(), 0u);
}

}  // namespace
}  // namespace needlelab
