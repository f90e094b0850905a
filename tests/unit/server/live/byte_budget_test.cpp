#include "server/live/byte_budget.h"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/live/context.h"

namespace needlelab {
namespace {

constexpr ByteBudget::Limits kLimits{
    .connection = 10, .person = 25, .people = 60, .station = 15, .server = 80};

BudgetOwner personAt(const std::string& name, int connection) {
  return {name + " " + std::to_string(connection), "person " + name, true};
}
BudgetOwner stationNamed(const std::string& name, int connection = 1) {
  return {name + " " + std::to_string(connection), "station " + name, false};
}

TEST(ByteBudget, aConnectionHasItsPartAndGetsItBack) {
  ByteBudget budget(kLimits);
  auto first = budget.take(personAt("anna", 1), 6);
  ASSERT_TRUE(first.has_value());
  EXPECT_FALSE(budget.take(personAt("anna", 1), 5).has_value());
  EXPECT_TRUE(budget.take(personAt("anna", 1), 4).has_value()) << "just what is left, and given back at once";
  EXPECT_EQ(budget.taken(), 6u);
  first.reset();
  EXPECT_EQ(budget.taken(), 0u);
  EXPECT_TRUE(budget.take(personAt("anna", 1), 10).has_value());
}

TEST(ByteBudget, aPersonHasItsPartHoweverManyConnectionsItHas) {
  ByteBudget budget(kLimits);
  std::vector<ByteBudget::Share> shares;
  for (int connection = 0; connection < 100; ++connection)
    if (auto share = budget.take(personAt("anna", connection), 10)) shares.push_back(std::move(*share));
  EXPECT_EQ(shares.size(), 2u) << "of 25";
  EXPECT_TRUE(budget.take(personAt("anna", 7), 5).has_value());
  EXPECT_TRUE(budget.take(personAt("bert", 7), 10).has_value()) << "others have theirs";
}

TEST(ByteBudget, whatPeopleMayNotTakeIsLeftToTheStations) {
  ByteBudget budget(kLimits);
  std::vector<ByteBudget::Share> shares;
  const auto fill = [&](auto owner_of) {
    const std::size_t before = shares.size();
    for (int i = 0; i < 100; ++i)
      if (auto share = budget.take(owner_of(i), 10)) shares.push_back(std::move(*share));
    return shares.size() - before;
  };
  EXPECT_EQ(fill([](int i) { return personAt("p" + std::to_string(i), i); }), 6u);
  EXPECT_EQ(fill([](int i) { return stationNamed("s" + std::to_string(i)); }), 2u);
  EXPECT_EQ(budget.taken(), 80u);
  shares.clear();
  EXPECT_EQ(fill([](int i) { return stationNamed("s" + std::to_string(i)); }), 8u) << "stations may have all";
}

TEST(ByteBudget, aStationHasItsPartHoweverManyConnectionsItHas) {
  ByteBudget budget(kLimits);
  std::vector<ByteBudget::Share> shares;
  for (int connection = 0; connection < 100; ++connection)
    if (auto share = budget.take(stationNamed("s1", connection), 5)) shares.push_back(std::move(*share));
  EXPECT_EQ(shares.size(), 3u) << "of 15";
  EXPECT_TRUE(budget.take(stationNamed("s2"), 10).has_value()) << "others have theirs";
}

TEST(ByteBudget, nobodyHasMoreThanAQuarterOfWhatThereIsForItsKind) {
  const ConnectionBounds bounds;
  for (const ByteBudget::Limits& limits : {bounds.decoded, bounds.replies}) {
    EXPECT_LE(4 * limits.person, limits.people);
    EXPECT_LE(4 * limits.station, limits.server - limits.people);
  }
}

TEST(ByteBudget, whatFitsNeverIsKnownAtOnce) {
  const ByteBudget budget(kLimits);
  EXPECT_EQ(budget.mostBytes(personAt("anna", 1)), 10u) << "of a connection";
  EXPECT_EQ(budget.mostBytes(stationNamed("s1")), 10u);
  const ByteBudget wide({.connection = 99, .person = 25, .people = 60, .station = 15, .server = 80});
  EXPECT_EQ(wide.mostBytes(personAt("anna", 1)), 25u);
  EXPECT_EQ(wide.mostBytes(stationNamed("s1")), 15u);
}

TEST(ByteBudget, tellsWheneverSomethingIsGivenBackAndOnlyOnce) {
  int freed = 0;
  std::optional<ByteBudget::Share> kept;
  {
    ByteBudget budget(kLimits, [&] { ++freed; });
    auto share = budget.take(personAt("anna", 1), 6);
    ByteBudget::Share moved = std::move(*share);
    share.reset();
    EXPECT_EQ(freed, 0) << "moved from";
    auto other = budget.take(personAt("bert", 1), 6);
    moved = std::move(*other);
    other.reset();
    EXPECT_EQ(freed, 1) << "what was overwritten is given back";
    EXPECT_EQ(budget.taken(), 6u);
    kept.emplace(std::move(moved));
  }
  kept.reset();
  EXPECT_EQ(freed, 2) << "a share may end after the budget";
}

TEST(ByteBudget, aShareThatCameToMoreThanItTookCountsAllAndOthersWait) {
  int freed = 0;
  ByteBudget budget(kLimits, [&] { ++freed; });
  auto share = budget.take(personAt("anna", 1), 5);
  share->become(22);
  EXPECT_EQ(budget.taken(), 22u) << "more than its connection may take";
  EXPECT_EQ(budget.mostTaken(), 22u);
  EXPECT_EQ(freed, 0);
  EXPECT_FALSE(budget.take(personAt("anna", 1), 1).has_value());
  EXPECT_FALSE(budget.take(personAt("anna", 2), 4).has_value()) << "of 25";
  EXPECT_TRUE(budget.take(personAt("anna", 2), 3).has_value());
  share->become(2);
  EXPECT_EQ(budget.taken(), 2u);
  EXPECT_TRUE(budget.take(personAt("anna", 1), 8).has_value());
  share.reset();
  EXPECT_EQ(budget.taken(), 0u);
  EXPECT_TRUE(budget.take(personAt("anna", 1), 10).has_value());
}

TEST(ByteBudget, aShareThatNeedsLessThanItTookGivesTheRestBackAtOnce) {
  int freed = 0;
  ByteBudget budget(kLimits, [&] { ++freed; });
  auto share = budget.take(personAt("anna", 1), 10);
  ASSERT_TRUE(share.has_value());
  share->lower(12);
  EXPECT_EQ(budget.taken(), 10u) << "it has no more than it took";
  EXPECT_EQ(freed, 0);
  share->lower(4);
  EXPECT_EQ(budget.taken(), 4u);
  EXPECT_EQ(freed, 1);
  EXPECT_TRUE(budget.take(personAt("anna", 1), 6).has_value());
  share.reset();
  EXPECT_EQ(budget.taken(), 0u);
  EXPECT_EQ(budget.mostTaken(), 10u);
  auto all = budget.take(personAt("anna", 1), 10);
  all->lower(0);
  EXPECT_EQ(budget.taken(), 0u);
}

}  // namespace
}  // namespace needlelab
