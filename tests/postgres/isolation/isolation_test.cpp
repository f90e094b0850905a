// What two servers do on one database at a time comes out as if one had come after the other: every request
// that has something stored, and what stations send, in forced interleavings.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "db/service/requests.h"
#include "tests/postgres/isolation/interleaving.h"
#include "tests/postgres/isolation/pairs_at_a_time.h"
#include "tests/postgres/isolation/shared_world.h"
#include "tests/unit/db/planted_here.h"

namespace needlelab::test {
namespace {

/// Where the first one is held: before each of its statements, if there are not more.
constexpr std::size_t kMostHolds = 30;

struct RunOutcome {
  std::string first, second, contents;
  bool operator==(const RunOutcome&) const = default;
};

/// The first line that one text has, and the other has not.
std::string firstDifference(const std::string& found, const std::string& wanted) {
  std::size_t at = 0, line = 0;
  while (at < found.size() && at < wanted.size() && found[at] == wanted[at]) {
    if (found[at] == '\n') line = at + 1;
    ++at;
  }
  const auto shown = [line](const std::string& text) {
    constexpr std::size_t kMost = 900;
    return text.substr(std::min(line, text.size()), std::min(text.find('\n', line), line + kMost) - line);
  };
  return found == wanted ? "as there" : "\n      found  " + shown(found) + "\n      wanted " + shown(wanted);
}

std::string differences(const RunOutcome& found, const RunOutcome& wanted) {
  return "\n    first answer: " + firstDifference(found.first, wanted.first) +
         "\n    second answer: " + firstDifference(found.second, wanted.second) +
         "\n    database: " + firstDifference(found.contents, wanted.contents);
}

class Isolation : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    world = std::make_unique<SharedWorld>();
    pairs = pairsAtATime(*world);
    if (const char* only = std::getenv("NEEDLELAB_ISOLATION_ONLY"))
      std::erase_if(pairs,
                    [&](const PairAtATime& pair) { return pair.name.find(only) == std::string::npos; });
  }
  static void TearDownTestSuite() {
    pairs.clear();
    world.reset();
  }
  void TearDown() override {
    bugPlantedHere().reset();
    world->putBack();
  }

  /// What came out of `answers`; puts the world back.
  static RunOutcome outcomeOf(const TwoAnswers& answers) {
    RunOutcome outcome{withoutTimes(answers.first), withoutTimes(answers.second), world->contents()};
    world->putBack();
    return outcome;
  }

  struct PairVerdict {
    std::vector<std::string> faults;  ///< interleavings that are as none of the two orders
    std::size_t runs = 0, waited = 0;
  };

  /// `first` is held, `second` goes on; `most_faults` end it.
  static PairVerdict lookAt(const ServerWork& first, const ServerWork& second, std::size_t most_faults) {
    PairVerdict verdict;
    const auto turned = runInTurn(world->other(), second, world->one(), first);
    const RunOutcome other_order = outcomeOf({turned.second, turned.first});
    const auto in_turn = runInTurn(world->one(), first, world->other(), second);
    const std::size_t statements = world->one().gate().count();
    const RunOutcome one_order = outcomeOf(in_turn);
    if (std::getenv("NEEDLELAB_ISOLATION_SHOW") != nullptr)
      std::printf("  %s\n  then %s\n  %zu statements\n", one_order.first.substr(0, 300).c_str(),
                  one_order.second.substr(0, 300).c_str(), statements);
    // before the first statement it would be the other order
    const std::size_t holds = statements > 0 ? statements - 1 : 0;
    const std::size_t step = holds / kMostHolds + 1;
    for (std::size_t held = 1; held < statements && verdict.faults.size() < most_faults; held += step) {
      const auto answers =
          runInterleaved(world->one(), first, world->other(), second, held, world->control());
      verdict.waited += answers.second_waited ? 1 : 0;
      ++verdict.runs;
      const std::string chain = world->faultOfAuditChain();
      const RunOutcome found = outcomeOf(answers);
      if (!chain.empty()) verdict.faults.push_back("held before " + std::to_string(held) + ": " + chain);
      if (found == one_order || found == other_order) continue;
      verdict.faults.push_back("held before statement " + std::to_string(held) + " of " +
                               std::to_string(statements) +
                               "; beside first, then second:" + differences(found, one_order) +
                               "\n  beside second, then first:" + differences(found, other_order));
    }
    return verdict;
  }

  static inline std::unique_ptr<SharedWorld> world;
  static inline std::vector<PairAtATime> pairs;
};

TEST_F(Isolation, everyRequestThatHasSomethingStoredIsAPairWithItself) {
  if (std::getenv("NEEDLELAB_ISOLATION_ONLY") != nullptr) GTEST_SKIP() << "some pairs only";
  std::set<pb::Request::CallCase> with_itself, with_others;
  for (const PairAtATime& pair : pairs) {
    if (pair.first_call == pair.second_call) with_itself.insert(pair.first_call);
    with_others.insert({pair.first_call, pair.second_call});
  }
  for (const RequestRow& row : requestRows()) {
    if (row.handler.storing == Storing::kNothing) continue;
    // of one program only one erasure is under way (erasures.cpp): it would wait where nobody sees it
    const bool is_there = row.call == pb::Request::kErasePerson ? with_others.contains(row.call)
                                                                : with_itself.contains(row.call);
    EXPECT_TRUE(is_there) << row.action << ": add it to pairs_at_a_time.cpp, from two people";
  }
}

TEST_F(Isolation, twoServersAtATimeAreAsOneAfterTheOther) {
  constexpr std::size_t kMostFaultsShown = 1;
  const std::int64_t deadlocks_before = world->deadlocks();
  std::size_t runs = 0, waited = 0;
  for (const PairAtATime& pair : pairs) {
    for (const bool mirrored : {false, true}) {
      SCOPED_TRACE(pair.name + (mirrored ? " (mirrored)" : ""));
      const PairVerdict verdict = mirrored ? lookAt(pair.second, pair.first, kMostFaultsShown)
                                           : lookAt(pair.first, pair.second, kMostFaultsShown);
      for (const std::string& fault : verdict.faults) ADD_FAILURE() << fault;
      runs += verdict.runs;
      waited += verdict.waited;
    }
  }
  // one waits for the other, and is not ended: there is nothing to repeat
  EXPECT_EQ(world->deadlocks(), deadlocks_before);
  if (std::getenv("NEEDLELAB_ISOLATION_ONLY") == nullptr) {
    EXPECT_GT(waited, runs / 4);
  }
  RecordProperty("interleavings", std::to_string(runs));
  RecordProperty("waited", std::to_string(waited));
  std::printf("%zu interleavings, in %zu one waited for the other\n", runs, waited);
}

TEST_F(Isolation, withoutTheLockOfTheStoreManyPairsComeOutOtherwise) {
  bugPlantedHere() = PlantedBug::kWritersTogether;
  std::set<std::string> caught;
  for (const PairAtATime& pair : pairs)
    if (!lookAt(pair.first, pair.second, 1).faults.empty()) caught.insert(pair.name);
  std::printf("%zu of %zu pairs come out otherwise\n", caught.size(), pairs.size());
  EXPECT_GT(caught.size(), pairs.size() / 2);
}

}  // namespace
}  // namespace needlelab::test
