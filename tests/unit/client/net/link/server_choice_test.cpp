// Which server and which address comes next, checked by prediction: no sockets, no name look-ups.
#include "client/net/link/server_choice.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/time/fake_time.h"

namespace needlelab {
namespace {

using test::FakeTime;
using testing::ElementsAre;
using Address = ServerChoice::Address;

Endpoints serversOf(const std::string& list) {
  return *parseEndpoints(list);
}

std::vector<Address> addressesOf(const std::vector<std::string>& texts) {
  std::vector<Address> all;
  for (const std::string& text : texts) all.push_back(asio::ip::make_address(text));
  return all;
}

/// A lab whose servers' names have these addresses; a name without an entry is not found.
class Lab {
 public:
  explicit Lab(const std::string& servers, std::uint64_t seed = 1) : choice(serversOf(servers), seed, time) {}

  /// One round: tries until `takes` accepts, and returns everything that was tried ("a/10.0.0.1"; a name that
  /// is not found: "a/?").
  std::vector<std::string> round(const std::function<bool(const std::string&)>& takes = nobody) {
    std::vector<std::string> tried;
    choice.beginRound();
    while (const Endpoint* const next = choice.next()) {
      const auto found = names.find(next->host);
      if (found == names.end()) {
        tried.push_back(next->host + "/?");
        choice.failed();
        continue;
      }
      tried.push_back(next->host + "/" + choice.take(addressesOf(found->second)).to_string());
      if (takes(tried.back())) {
        choice.welcomed();
        return tried;
      }
      choice.failed();
    }
    return tried;
  }
  static bool nobody(const std::string&) { return false; }
  static std::function<bool(const std::string&)> only(const std::string& place) {
    return [place](const std::string& tried) { return tried == place; };
  }

  FakeTime time;
  ServerChoice choice;
  std::map<std::string, std::vector<std::string>> names = {
      {"a", {"10.0.0.1"}}, {"b", {"10.0.0.2"}}, {"c", {"10.0.0.3"}}};
};

TEST(ServerChoice, oneServerIsTriedOnceARound) {
  Lab lab("a");
  for (int n = 0; n < 3; ++n) EXPECT_THAT(lab.round(), ElementsAre("a/10.0.0.1"));
  EXPECT_FALSE(lab.choice.several());
  EXPECT_THAT(lab.round(Lab::only("a/10.0.0.1")), ElementsAre("a/10.0.0.1"));
  lab.choice.lost();
  EXPECT_FALSE(lab.choice.hasOther());
  EXPECT_THAT(lab.round(), ElementsAre("a/10.0.0.1"));
}

TEST(ServerChoice, aRoundTriesAllAddressesInTheirWrittenOrder) {
  Lab lab("b,a,c");
  EXPECT_TRUE(lab.choice.several());
  for (int n = 0; n < 3; ++n) EXPECT_THAT(lab.round(), ElementsAre("b/10.0.0.2", "a/10.0.0.1", "c/10.0.0.3"));
}

TEST(ServerChoice, whoHasAnsweredStaysTheFirstUntilItFails) {
  Lab lab("a,b,c");
  EXPECT_THAT(lab.round(Lab::only("b/10.0.0.2")), ElementsAre("a/10.0.0.1", "b/10.0.0.2"));
  // lost: the others first; c has never failed, a failed a while ago
  lab.choice.lost();
  EXPECT_THAT(lab.round(), ElementsAre("c/10.0.0.3", "a/10.0.0.1", "b/10.0.0.2"));
  // none answered: the one that failed longest ago comes first, and so on in a circle
  EXPECT_THAT(lab.round(Lab::only("a/10.0.0.1")), ElementsAre("c/10.0.0.3", "a/10.0.0.1"));
  EXPECT_THAT(lab.round(Lab::only("a/10.0.0.1")), ElementsAre("a/10.0.0.1")) << "it has answered";
  lab.choice.lost();
  EXPECT_THAT(lab.round(Lab::only("b/10.0.0.2")), ElementsAre("b/10.0.0.2"));
}

// the same rule written differently: a list in which a server that fails moves to the end and one that
// accepts moves to the front
TEST(ServerChoice, aThousandRandomRoundsFollowTheRule) {
  Lab lab("a,b,c");
  std::vector<std::string> order = {"a/10.0.0.1", "b/10.0.0.2", "c/10.0.0.3"};
  const auto moveToEnd = [&order](const std::string& place) {
    order.erase(std::find(order.begin(), order.end(), place));
    order.push_back(place);
  };
  std::mt19937_64 random(5);
  std::map<std::string, bool> failed;
  for (int n = 0; n < 1000; ++n) {
    const std::uint64_t up = random() % 8;  // one bit per server
    const auto takes = [&](const std::string& place) { return (up >> (place[0] - 'a') & 1) != 0; };
    std::vector<std::string> expected;
    const std::vector<std::string> before = order;
    std::string welcome;
    for (const std::string& place : before) {
      expected.push_back(place);
      if (takes(place)) {
        welcome = place;
        break;
      }
      moveToEnd(place);
      failed[place] = true;
    }
    ASSERT_EQ(lab.round(takes), expected) << n;
    if (welcome.empty()) continue;
    order.erase(std::find(order.begin(), order.end(), welcome));
    // followed by those that have not failed, in the order given
    order.insert(order.begin(), welcome);
    failed[welcome] = false;
    std::stable_sort(order.begin() + 1, order.end(), [&](const std::string& x, const std::string& y) {
      if (failed[x] != failed[y]) return failed[y];
      return !failed[x] && x < y;
    });
    if (random() % 2 == 0) {
      lab.choice.lost();
      moveToEnd(welcome);
      failed[welcome] = true;
    }
  }
}

TEST(ServerChoice, aSharedRefusalEndsTheRoundAndTheNextStartsThere) {
  Lab lab("a,b");
  lab.choice.beginRound();
  ASSERT_EQ(lab.choice.next()->host, "a");
  lab.choice.take(addressesOf({"10.0.0.1"}));
  lab.choice.failed();
  ASSERT_EQ(lab.choice.next()->host, "b");
  lab.choice.take(addressesOf({"10.0.0.2"}));
  lab.choice.refused();
  EXPECT_EQ(lab.choice.next(), nullptr);
  for (int n = 0; n < 3; ++n) {
    lab.choice.beginRound();
    ASSERT_EQ(lab.choice.next()->host, "b") << "the key is not tried at another server";
    lab.choice.take(addressesOf({"10.0.0.2"}));
    lab.choice.refused();
    EXPECT_EQ(lab.choice.next(), nullptr);
  }
}

TEST(ServerChoice, eachAddressOfANameIsAPlace) {
  Lab lab("a,b");
  lab.names["a"] = {"fe80::1", "10.0.0.1"};
  EXPECT_THAT(lab.round(), ElementsAre("a/fe80::1", "a/10.0.0.1", "b/10.0.0.2"));
  EXPECT_THAT(lab.round(Lab::only("a/10.0.0.1")), ElementsAre("a/fe80::1", "a/10.0.0.1"));
  lab.choice.lost();
  EXPECT_THAT(lab.round(), ElementsAre("b/10.0.0.2", "a/fe80::1", "a/10.0.0.1"));
}

TEST(ServerChoice, aNameThatIsNotFoundCostsItsTurnOnly) {
  Lab lab("a,b");
  const auto address = std::exchange(lab.names["a"], {});
  lab.names.erase("a");
  EXPECT_THAT(lab.round(), ElementsAre("a/?", "b/10.0.0.2"));
  lab.names["a"] = address;
  EXPECT_THAT(lab.round(), ElementsAre("a/10.0.0.1", "b/10.0.0.2"));
  // also when it was known before
  lab.names.erase("a");
  EXPECT_THAT(lab.round(Lab::only("b/10.0.0.2")), ElementsAre("a/?", "b/10.0.0.2"));
}

TEST(ServerChoice, addressesThatComeAreNewAndThoseThatGoAreForgotten) {
  Lab lab("a");
  lab.names["a"] = {"10.0.0.1", "fe80::1"};
  lab.round();
  lab.names["a"] = {"fe80::1", "10.0.0.1", "fe80::2"};
  EXPECT_THAT(lab.round(), ElementsAre("a/fe80::2", "a/10.0.0.1", "a/fe80::1"))
      << "the new one has not failed";
  lab.names["a"] = {"10.0.0.9"};
  EXPECT_THAT(lab.round(Lab::only("a/10.0.0.9")), ElementsAre("a/10.0.0.9"));
  EXPECT_FALSE(lab.choice.several());
  lab.names["a"].clear();
  for (int n = 1; n <= 40; ++n) lab.names["a"].push_back("10.0.1." + std::to_string(n));
  EXPECT_EQ(lab.round().size(), ServerChoice::kMaxAddresses);
}

TEST(ServerChoice, aTryAgainIsAtTheSameAddress) {
  Lab lab("a");
  lab.choice.beginRound();
  lab.choice.next();
  const auto first = lab.choice.take(addressesOf({"10.0.0.1", "10.0.0.2"}));
  EXPECT_EQ(lab.choice.take(addressesOf({"10.0.0.2", "10.0.0.1"})), first);
}

// A name's addresses of one family are tried in random order; the families keep the system's order.
TEST(ServerChoice, aThousandStationsSpreadEvenlyOverANamesAddresses) {
  std::map<std::string, int> first;
  std::map<std::string, int> second_after_10_0_0_1;
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    Lab lab("a", seed);
    lab.names["a"] = {"fe80::1", "10.0.0.1", "10.0.0.2", "10.0.0.3"};
    const auto tried = lab.round();
    ASSERT_EQ(tried.size(), 4u);
    EXPECT_EQ(tried[0], "a/fe80::1") << seed;
    ++first[tried[1]];
    if (tried[1] == "a/10.0.0.1") ++second_after_10_0_0_1[tried[2]];
    Lab same("a", seed);
    same.names = lab.names;
    EXPECT_EQ(same.round(), tried) << "a seed gives the same";
  }
  // binomial: 333 ± 15; tolerance four deviations
  ASSERT_EQ(first.size(), 3u);
  for (const auto& [place, times] : first) EXPECT_NEAR(times, 333, 60) << place;
  ASSERT_EQ(second_after_10_0_0_1.size(), 2u);
  for (const auto& [place, times] : second_after_10_0_0_1) EXPECT_NEAR(times, 167, 50) << place;
}

TEST(ServerChoice, anotherIsBetterUntilItFailedAMinuteAgo) {
  Lab lab("a,b");
  EXPECT_FALSE(lab.choice.hasBetter()) << "nowhere yet";
  lab.round(Lab::only("a/10.0.0.1"));
  EXPECT_TRUE(lab.choice.hasOther());
  EXPECT_TRUE(lab.choice.hasBetter());
  lab.choice.lost();
  lab.round(Lab::only("b/10.0.0.2"));
  EXPECT_TRUE(lab.choice.hasOther());
  EXPECT_FALSE(lab.choice.hasBetter()) << "a was left just now";
  lab.time.advance(59'999'999'999);
  EXPECT_FALSE(lab.choice.hasBetter());
  lab.time.advance(1);
  EXPECT_TRUE(lab.choice.hasBetter());
}

TEST(ServerChoice, theOtherFamilyOfANameIsNoOtherServer) {
  Lab lab("a");
  lab.names["a"] = {"::1", "127.0.0.1"};
  lab.round(Lab::only("a/127.0.0.1"));
  EXPECT_TRUE(lab.choice.several());
  EXPECT_FALSE(lab.choice.hasOther());
  lab.names["a"] = {"::1", "127.0.0.1", "127.0.0.2"};
  lab.choice.lost();
  lab.round(Lab::only("a/127.0.0.1"));
  EXPECT_TRUE(lab.choice.hasOther());
}

}  // namespace
}  // namespace needlelab
