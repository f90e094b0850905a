#include "server/live/limits/byte_budget.h"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "server/live/limits/limits.h"

namespace needlelab {
namespace {

constexpr ByteBudget::Limits kLimits{.person = 10, .people = 30, .station = 15, .server = 50};

BudgetOwner personNamed(const std::string& name) {
  return {"person " + name, true};
}
BudgetOwner stationNamed(const std::string& name) {
  return {"station " + name, false};
}

TEST(ByteBudget, eachHasItsPartAndGetsItBack) {
  for (const auto& [owner, other, most] : {std::tuple(personNamed("anna"), personNamed("bert"), 10u),
                                           std::tuple(stationNamed("s1"), stationNamed("s2"), 15u)}) {
    ByteBudget budget(kLimits);
    EXPECT_EQ(budget.mostBytes(owner), most) << "more fits never";
    EXPECT_FALSE(budget.take(owner, most + 1).has_value());
    auto first = budget.take(owner, 6);
    ASSERT_TRUE(first.has_value());
    EXPECT_FALSE(budget.take(owner, most - 5).has_value());
    EXPECT_TRUE(budget.take(owner, most - 6).has_value()) << "just what is left, and given back at once";
    EXPECT_TRUE(budget.take(other, most).has_value()) << "others have theirs";
    EXPECT_EQ(budget.taken(), 6u);
    first.reset();
    EXPECT_EQ(budget.taken(), 0u);
    EXPECT_TRUE(budget.take(owner, most).has_value());
  }
}

TEST(ByteBudget, whatPeopleMayNotTakeIsLeftToTheStations) {
  ByteBudget budget(kLimits);
  std::vector<ByteBudget::Share> shares;
  const auto fill = [&](auto owner_of) {
    const std::size_t before = shares.size();
    for (int i = 0; i < 100; ++i)
      if (auto share = budget.take(owner_of(std::to_string(i)), 10)) shares.push_back(std::move(*share));
    return shares.size() - before;
  };
  EXPECT_EQ(fill(personNamed), 3u);
  EXPECT_EQ(fill(stationNamed), 2u);
  EXPECT_EQ(budget.taken(), 50u);
  shares.clear();
  EXPECT_EQ(fill(stationNamed), 5u) << "stations may have all";
}

TEST(ByteBudget, noPeerHasMoreThanAQuarterOfItsKind) {
  const ConnectionBounds bounds;
  for (const ByteBudget::Limits& limits : {bounds.decoded, bounds.replies}) {
    EXPECT_LE(4 * limits.person, limits.people);
    EXPECT_LE(4 * limits.station, limits.server - limits.people);
  }
}

TEST(ByteBudget, tellsWheneverSomethingIsGivenBackAndOnlyOnce) {
  int freed = 0;
  std::optional<ByteBudget::Share> kept;
  {
    ByteBudget budget(kLimits, [&] { ++freed; });
    auto share = budget.take(personNamed("anna"), 6);
    ByteBudget::Share moved = std::move(*share);
    share.reset();
    EXPECT_EQ(freed, 0) << "moved from";
    auto other = budget.take(personNamed("bert"), 6);
    moved = std::move(*other);
    other.reset();
    EXPECT_EQ(freed, 1) << "overwritten bytes are given back";
    EXPECT_EQ(budget.taken(), 6u);
    kept.emplace(std::move(moved));
  }
  kept.reset();
  EXPECT_EQ(freed, 2) << "a share may end after the budget";
}

TEST(ByteBudget, aShareThatGrewCountsWhollyAndOthersWait) {
  int freed = 0;
  ByteBudget budget(kLimits, [&] { ++freed; });
  auto share = budget.take(personNamed("anna"), 5);
  share->become(22);
  EXPECT_EQ(budget.taken(), 22u) << "more than it may take";
  EXPECT_EQ(budget.mostTaken(), 22u);
  EXPECT_EQ(freed, 0);
  EXPECT_FALSE(budget.take(personNamed("anna"), 1).has_value());
  EXPECT_FALSE(budget.take(personNamed("bert"), 9).has_value()) << "of 30";
  EXPECT_TRUE(budget.take(personNamed("bert"), 8).has_value());
  share->become(2);
  EXPECT_EQ(budget.taken(), 2u);
  EXPECT_TRUE(budget.take(personNamed("anna"), 8).has_value());
  share.reset();
  EXPECT_EQ(budget.taken(), 0u);
  EXPECT_TRUE(budget.take(personNamed("anna"), 10).has_value());
}

TEST(ByteBudget, aShrunkShareReturnsTheRestAtOnce) {
  int freed = 0;
  ByteBudget budget(kLimits, [&] { ++freed; });
  auto share = budget.take(personNamed("anna"), 10);
  ASSERT_TRUE(share.has_value());
  EXPECT_EQ(freed, 0);
  share->become(4);
  EXPECT_EQ(budget.taken(), 4u);
  EXPECT_EQ(freed, 1);
  EXPECT_TRUE(budget.take(personNamed("anna"), 6).has_value());
  share.reset();
  EXPECT_EQ(budget.taken(), 0u);
  EXPECT_EQ(budget.mostTaken(), 10u);
  auto all = budget.take(personNamed("anna"), 10);
  all->become(0);
  EXPECT_EQ(budget.taken(), 0u);
}

// Admits chunks waiting for their commit until full, then releases the first half.
TEST(ByteBudget, isFullFromItsLimitToHalfOfIt) {
  ByteBudget budget({.server = 1000});
  const BudgetOwner bench{.name = "bench-1", .person = false};
  struct Step {
    int bytes;  ///< below 0: returned
    bool full;
  };
  for (const auto& [bytes, full] : {Step{900, false},
                                    {99, false},
                                    {1, true},
                                    {500, true},
                                    {-500, true},
                                    {-499, true},
                                    {-1, false},
                                    {499, false},
                                    {1, true},
                                    {-1000, false}}) {
    if (bytes > 0)
      budget.add(bench, static_cast<std::size_t>(bytes));
    else
      budget.giveBack(bench, static_cast<std::size_t>(-bytes));
    EXPECT_EQ(budget.full(), full) << budget.taken();
  }
  EXPECT_EQ(budget.taken(), 0u);
}

TEST(ByteBudget, knowsWhatEachHasAndForgetsWhoHasNothing) {
  ByteBudget budget(kLimits);
  const BudgetOwner bench{.name = "bench-1", .person = false}, other{.name = "bench-2", .person = false};
  budget.add(bench, 10);
  budget.add(bench, 20);
  EXPECT_EQ(budget.takenBy("bench-1"), 30u) << "more than it may take: it is in memory already";
  EXPECT_EQ(budget.takenBy("bench-2"), 0u);
  EXPECT_FALSE(budget.take(bench, 1).has_value());
  EXPECT_TRUE(budget.take(other, 1).has_value());
  budget.giveBack(bench, 10);
  budget.giveBack(bench, 20);
  EXPECT_EQ(budget.takenBy("bench-1"), 0u);
}

// A station's closes: items instead of bytes.
TEST(ByteBudget, whatIsNotGivenHasNoBound) {
  ByteBudget closes({.station = 3});
  const BudgetOwner bench{.name = "bench", .person = false}, cabin{.name = "cabin", .person = false};
  std::vector<ByteBudget::Share> places;
  for (const BudgetOwner& station : {bench, cabin}) {
    for (int n = 0; n < 3; ++n) {
      auto place = closes.take(station, 1);
      ASSERT_TRUE(place.has_value());
      places.push_back(std::move(*place));
    }
    EXPECT_FALSE(closes.take(station, 1).has_value());
  }
  places.pop_back();
  EXPECT_TRUE(closes.take(cabin, 1).has_value());
  EXPECT_FALSE(closes.take(bench, 1).has_value());
  EXPECT_FALSE(closes.full());
}

}  // namespace
}  // namespace needlelab
