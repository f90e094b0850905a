#include "common/base/text/text.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

namespace needlelab {
namespace {

/// The definition itself: the minimum over the last edit, without a table. For short ASCII texts.
std::size_t distanceByDefinition(std::string_view a, std::string_view b) {
  if (a.empty() || b.empty()) return a.size() + b.size();
  const std::string_view a1 = a.substr(1), b1 = b.substr(1);
  std::size_t least = std::min(distanceByDefinition(a1, b), distanceByDefinition(a, b1)) + 1;
  least = std::min(least, distanceByDefinition(a1, b1) + (a[0] == b[0] ? 0 : 1));
  if (a.size() > 1 && b.size() > 1 && a[0] == b[1] && a[1] == b[0])
    least = std::min(least, distanceByDefinition(a.substr(2), b.substr(2)) + 1);
  return least;
}

TEST(EditDistance, isThatOfItsDefinition) {
  std::mt19937 random(17);
  const auto text = [&] {
    std::string made;
    for (std::size_t i = random() % 6; i > 0; --i) made += "abc"[random() % 3];
    return made;
  };
  std::map<std::size_t, int> seen;
  for (int i = 0; i < 2000; ++i) {
    const std::string a = text(), b = text();
    const std::size_t expected = distanceByDefinition(a, b);
    EXPECT_EQ(editDistance(a, b, 10), expected) << a << " " << b;
    ++seen[expected];
    if (expected == 0) continue;
    EXPECT_EQ(editDistance(a, b, expected - 1), std::nullopt) << a << " " << b;
  }
  EXPECT_GE(seen.size(), 5u);
}

TEST(EditDistance, countsCharactersAndNotBytesOrCapitals) {
  EXPECT_EQ(editDistance("zoë", "zoe", 3), 1u);
  EXPECT_EQ(editDistance("zoë", "ozë", 3), 1u);
  EXPECT_EQ(editDistance("€", "", 3), 1u);
  EXPECT_EQ(editDistance("TOM", "tom", 0), 0u);
}

TEST(EditDistance, longTextsHaveNone) {
  const std::string longest(kMaxComparedBytes, 'a');
  EXPECT_EQ(editDistance(longest, longest, 1), 0u);
  EXPECT_EQ(editDistance(longest + "a", longest + "a", 1), std::nullopt);
  EXPECT_EQ(editDistance("", longest + "a", 1000), std::nullopt);
}

TEST(NearNames, theNearestComeFirst) {
  const std::vector<KnownName> known = {
      {"tim", ""}, {"tom", "Tom Smith"}, {"anna.bauer", "Anna Bauer"}, {"ben", "Benedikt Tmo"}, {"zoe", ""}};
  const auto names = [&](std::string_view typed, std::size_t count = 3) {
    std::vector<std::string> found;
    for (const KnownName& person : nearNames(typed, known, count)) found.push_back(person.name);
    return found;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(names("tmo"), Names{"tom"}) << "a swap is one edit; tim is two";
  EXPECT_EQ(names("tam"), (Names{"tim", "tom"})) << "equally near: by name";
  EXPECT_EQ(names("tam", 1), Names{"tim"});
  EXPECT_EQ(names("TOM"), (Names{"tom", "tim"}));
  EXPECT_EQ(names("anna.baur"), Names{"anna.bauer"});
  EXPECT_EQ(names("anna bauer"), Names{"anna.bauer"}) << "the full name, typed in the name's place";
  EXPECT_EQ(names("quite another"), Names{});
  EXPECT_EQ(names(std::string(1000, 't')), Names{});
  EXPECT_TRUE(nearNames("tom", {}).empty());
}

}  // namespace
}  // namespace needlelab
