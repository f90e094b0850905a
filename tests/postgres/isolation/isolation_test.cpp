// The results of two servers working on one database at the same time equal one of the two sequential orders:
// every request that stores something, and everything stations send, in forced interleavings.
// The short form takes each eighth pair and holds its first one before up to 5 of its statements; the long
// form (NEEDLELAB_LONG=1) takes all pairs and up to 60 statements. NEEDLELAB_ISOLATION_ONLY=TEXT: only the
// pairs whose name contains this text.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "db/service/requests/requests.h"
#include "tests/postgres/isolation/interleaving.h"
#include "tests/postgres/isolation/pairs_at_a_time.h"
#include "tests/postgres/isolation/shared_world.h"
#include "tests/support/run_form.h"
#include "tests/unit/db/planted_here.h"

namespace needlelab::test {
namespace {

/// At how many of its statements the first one is held; NEEDLELAB_ISOLATION_HOLDS=N: at N. Within a
/// transaction, after the lock, all are equivalent: so the beginnings and ends come first.
std::size_t mostHolds() {
  if (const char* given = std::getenv("NEEDLELAB_ISOLATION_HOLDS"))
    return static_cast<std::size_t>(std::max(1, std::atoi(given)));
  return longForm() ? 60 : 5;
}

/// At most `most` of them, evenly spread.
std::vector<std::size_t> someOf(const std::vector<std::size_t>& all, std::size_t most) {
  std::vector<std::size_t> some;
  const std::size_t count = std::min(most, all.size());
  for (std::size_t i = 0; i < count; ++i) some.push_back(all[(2 * i + 1) * all.size() / (2 * count)]);
  return some;
}

/// Statement numbers from those counted by `gate`. Not the first: that would be the other order.
std::vector<std::size_t> holdsOf(const StatementGate& gate, std::size_t most) {
  std::vector<std::size_t> edges = gate.edges(), others;
  std::erase(edges, 0);
  for (std::size_t i = 1; i < gate.count(); ++i)
    if (!std::binary_search(edges.begin(), edges.end(), i)) others.push_back(i);
  // at least one of the others
  std::vector<std::size_t> holds = someOf(edges, std::max<std::size_t>(most, 2) - 1);
  const auto more = someOf(others, most - std::min(most, holds.size()));
  holds.insert(holds.end(), more.begin(), more.end());
  std::sort(holds.begin(), holds.end());
  return holds;
}

/// Without the sentence that begins with `beginning`; if that is empty, unchanged.
std::string withoutSentence(std::string text, const std::string& beginning) {
  const std::size_t at = beginning.empty() ? std::string::npos : text.find(beginning);
  constexpr std::string_view kEnd = ". ";
  const std::size_t end = at == std::string::npos ? at : text.find(kEnd, at);
  return end == std::string::npos ? text : text.erase(at, end + kEnd.size() - at);
}

/// An answer gets its names after its commit (service.cpp), when an erasure beside it may have taken carl's.
std::string besideErasure(pb::Request::CallCase other, std::string answer) {
  if (other != pb::Request::kErasePerson) return answer;
  const std::string erased = "\"erased person 8\"", name = "\"carl\"";
  for (std::size_t at = 0; (at = answer.find(erased, at)) != std::string::npos; at += name.size())
    answer.replace(at, erased.size(), name);
  return answer;
}

struct RunOutcome {
  std::string first, second, contents;
  bool operator==(const RunOutcome&) const = default;
};

/// The first line that one text has and the other has not.
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

/// Pairs of the same kind, by the beginnings of their names, that do not need the store's lock: one
/// statement, or a row's own lock, orders them. All others must give a different result without it.
constexpr const char* kOrderedAnyway[] = {
    "ada: set_password",
    "ada: set_code { name: 'anna'",
    "ada: disable_user { name: 'carl' } | mia: disable_user { name: 'carl' enable: true }",
    "ada: change_user { name: 'anna' base_revision: 1 full_name: 'Anna One' } | mia: change_user { name: "
    "'anna' "
    "base_revision: 2",
    "ina: rescore_session",
    "mia: rescore_all",
    "ada: change_lab_settings { codes_required: true } | abe: change_lab_settings { codes_required: false }",
    "ada: backup { path: {restored}",
    "ada: set_retention",
    "ada: run_retention",
    "a chunk | and once more",
    "a chunk | and another one in its place",
    "a chunk | and the one behind it",
    "a chunk | and the close with it",
    "a close | and once more",
    "a close | and one with more chunks",
    "a chunk that cannot be decoded | and the one behind it"};

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
    if (bugPlantedHere()) {
      bugPlantedHere().reset();
      world->connectAnew();
    }
    world->putBack();
  }

  static std::string comparedContents(const PairAtATime& pair) {
    return world->contents(indivisibleOf(pair.first_call) != Indivisible::kSteps &&
                           indivisibleOf(pair.second_call) != Indivisible::kSteps);
  }

  /// The result, as far as the two requests guarantee it; restores the world.
  static RunOutcome outcomeOf(const PairAtATime& pair, const TwoAnswers& answers) {
    RunOutcome outcome;
    if (indivisibleOf(pair.first_call) == Indivisible::kWhole)
      outcome.first =
          besideErasure(pair.second_call, withoutTimes(withoutSentence(answers.first, pair.told_later)));
    if (indivisibleOf(pair.second_call) == Indivisible::kWhole)
      outcome.second =
          besideErasure(pair.first_call, withoutTimes(withoutSentence(answers.second, pair.told_later)));
    outcome.contents = comparedContents(pair);
    world->putBack();
    return outcome;
  }

  /// The result if one of them comes between the two commits of the other; nothing: neither has two.
  static std::optional<RunOutcome> betweenCommits(const PairAtATime& pair) {
    if (!pair.first_commits && !pair.second_commits) return {};
    for (OneServer* server : {&world->one(), &world->other()}) server->startAnew();
    const InTwoCommits& two = pair.first_commits ? *pair.first_commits : *pair.second_commits;
    std::string whole = two.begins(world->one());
    const std::string other = (pair.first_commits ? pair.second : pair.first)(world->other());
    whole += two.ends(world->one());
    return outcomeOf(pair, pair.first_commits ? TwoAnswers{whole, other} : TwoAnswers{other, whole});
  }

  struct PairVerdict {
    std::optional<std::string> fault;  ///< the first interleaving that equals neither order
    std::size_t runs = 0, waited = 0;
    /// It changes something that is compared, alone or after the other one, or is answered differently there:
    /// otherwise the pair proves nothing.
    bool first_matters = false, second_matters = false;
  };

  /// Holds the first one before its statements, one after another, up to the first fault.
  static PairVerdict lookAt(const PairAtATime& pair, std::size_t most_holds = mostHolds()) {
    PairVerdict verdict;
    std::string between_them;
    const auto look = [&] { between_them = comparedContents(pair); };
    const auto turned = runInTurn(world->other(), pair.second, world->one(), pair.first, look);
    const RunOutcome other_order = outcomeOf(pair, {turned.second, turned.first});
    verdict.first_matters = other_order.contents != between_them;
    verdict.second_matters = !between_them.empty();
    const auto in_turn = runInTurn(world->one(), pair.first, world->other(), pair.second, look);
    const std::size_t statements = world->one().gate().count();
    const std::vector<std::size_t> holds = holdsOf(world->one().gate(), most_holds);
    const RunOutcome one_order = outcomeOf(pair, in_turn);
    verdict.first_matters |= !between_them.empty() || one_order.first != other_order.first;
    verdict.second_matters |= one_order.contents != between_them || one_order.second != other_order.second;
    const auto between = betweenCommits(pair);
    for (const std::size_t held : holds) {
      const auto answers =
          runInterleaved(world->one(), pair.first, world->other(), pair.second, held, world->control());
      verdict.waited += answers.second_waited ? 1 : 0;
      ++verdict.runs;
      const std::string chain = world->faultOfAuditChain();
      const RunOutcome found = outcomeOf(pair, answers);
      if (chain.empty() && (found == one_order || found == other_order || found == between)) continue;
      verdict.fault = "held before statement " + std::to_string(held) + " of " + std::to_string(statements) +
                      "; beside first, then second:" + differences(found, one_order) +
                      "\n  beside second, then first:" + differences(found, other_order) +
                      (chain.empty() ? "" : "\n  audit log: " + chain);
      break;
    }
    return verdict;
  }

  /// The pairs of this form: each eighth, or all.
  static std::vector<PairAtATime> pairsOfThisForm() {
    if (longForm() || std::getenv("NEEDLELAB_ISOLATION_ONLY") != nullptr) return pairs;
    constexpr std::size_t kStep = 8;
    std::vector<PairAtATime> some;
    for (std::size_t i = 0; i < pairs.size(); i += kStep) some.push_back(pairs[i]);
    return some;
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
    // one program runs only one erasure at a time (erasures.cpp): it would wait in a way not visible here
    const bool is_there = row.call == pb::Request::kErasePerson ? with_others.contains(row.call)
                                                                : with_itself.contains(row.call);
    EXPECT_TRUE(is_there) << row.action << ": add it to pairs_at_a_time.cpp, from two people";
  }
}

TEST_F(Isolation, twoServersAtATimeAreAsOneAfterTheOther) {
  const std::int64_t deadlocks_before = world->deadlocks();
  std::size_t runs = 0, waited = 0;
  const auto look = [&](const PairAtATime& pair) {
    const PairVerdict verdict = lookAt(pair);
    EXPECT_FALSE(verdict.fault.has_value()) << pair.name << "\n  " << *verdict.fault;
    EXPECT_TRUE(verdict.first_matters && verdict.second_matters)
        << pair.name << "\n  the " << (verdict.first_matters ? "second" : "first")
        << " one changes nothing, and is answered the same, alone and behind the other";
    runs += verdict.runs;
    waited += verdict.waited;
  };
  for (const PairAtATime& pair : pairsOfThisForm()) {
    look(pair);
    // for two equal requests the mirrored order differs only in names
    if (pair.first_call != pair.second_call || pair.first_call == pb::Request::CALL_NOT_SET)
      look({"mirrored: " + pair.name, pair.second, pair.first, pair.second_call, pair.first_call,
            pair.told_later, pair.second_commits, pair.first_commits});
  }
  // one waits for the other, and PostgreSQL ends neither: nothing is repeated
  EXPECT_EQ(world->deadlocks(), deadlocks_before);
  EXPECT_GT(waited, runs / 4);
  std::printf("%zu interleavings; in %zu one waited for the other\n", runs, waited);
}

TEST_F(Isolation, withoutTheStoreLockDependentPairsGiveWrongResults) {
  bugPlantedHere() = PlantedBug::kWritersTogether;
  world->connectAnew();
  std::size_t caught = 0, looked_at = 0;
  for (const PairAtATime& pair : pairsOfThisForm()) {
    const bool is_ordered_anyway =
        std::any_of(std::begin(kOrderedAnyway), std::end(kOrderedAnyway),
                    [&](const char* beginning) { return pair.name.starts_with(beginning); });
    if (pair.first_call != pair.second_call || is_ordered_anyway) continue;
    ++looked_at;
    constexpr std::size_t kMostHolds = 60;  // it ends at the first fault
    const bool is_caught = lookAt(pair, kMostHolds).fault.has_value();
    EXPECT_TRUE(is_caught) << pair.name << ": comes out as one after the other without the lock of the store";
    caught += is_caught ? 1 : 0;
  }
  std::printf("%zu of %zu pairs come out otherwise\n", caught, looked_at);
}

}  // namespace
}  // namespace needlelab::test
