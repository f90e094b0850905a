#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "client/effect_cost/tick_cost.h"
#include "client/sim/effects_study.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/text/csv.h"
#include "common/haptics/effects/effect_entry.h"
#include "tests/support/sanitized.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab::test {
namespace {

using ::testing::HasSubstr;

EffectSetCost cost(EffectMask effects, double ns, std::optional<double> instructions = {}) {
  EffectSetCost made;
  made.scene = "layers";
  made.effects = effects;
  made.timing.median_ns = ns;
  made.instructions = instructions;
  return made;
}

TEST(MarginalCosts, areTheMeanOverThePairsThatDifferInOneEffectOnly) {
  constexpr EffectMask kCut = bitOf(Effect::kCutting), kClamp = bitOf(Effect::kClamping);
  const auto costs = marginalCosts(
      {cost(0, 7, 100), cost(kCut, 9, 130), cost(kClamp, 10, 150), cost(kCut | kClamp, 15, 190)});
  ASSERT_EQ(costs.size(), 2u) << "effects that no set has are not in it";
  EXPECT_EQ(costs[0].effect, Effect::kCutting);
  EXPECT_DOUBLE_EQ(costs[0].mean_ns, 3.5);
  EXPECT_DOUBLE_EQ(costs[0].min_ns, 2);
  EXPECT_DOUBLE_EQ(costs[0].max_ns, 5);
  EXPECT_DOUBLE_EQ(*costs[0].instructions, 35);
  EXPECT_EQ(costs[1].effect, Effect::kClamping);
  EXPECT_DOUBLE_EQ(costs[1].mean_ns, 4.5);
}

TEST(MarginalCosts, pairSetsOfOneSceneOnly) {
  auto sets = {cost(0, 7, 100), cost(1, 9, 130), cost(0, 20, 300), cost(1, 25, 370)};
  std::vector<EffectSetCost> two(sets);
  two[2].scene = two[3].scene = "a body";
  const auto costs = marginalCosts(two);
  ASSERT_EQ(costs.size(), 2u);
  EXPECT_EQ(costs[0].scene, "layers");
  EXPECT_EQ(costs[0].max_instructions, 30);
  EXPECT_EQ(costs[1].scene, "a body");
  EXPECT_EQ(costs[1].min_instructions, 70);
}

TEST(MarginalCosts, areNotCountedWhereACountIsMissing) {
  const auto costs = marginalCosts({cost(0, 7), cost(1, 9, 130)});
  ASSERT_EQ(costs.size(), 1u);
  EXPECT_FALSE(costs[0].instructions);
}

// Compares words, since the columns differ only in blanks between them.
std::vector<std::string> wordsOf(const std::string& line) {
  std::istringstream text(line);
  std::vector<std::string> words;
  for (std::string word; text >> word;) words.push_back(word);
  return words;
}

std::vector<std::string> tableLines(const std::string& text) {
  std::istringstream all(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(all, line);) lines.push_back(line);
  return lines;
}

// "x" for the effects in the set, "." for the others
std::vector<std::string> marksOf(EffectMask effects) {
  std::vector<std::string> marks;
  for (const EffectEntry* effect : effectEntries())
    marks.emplace_back((effects & bitOf(effect->effect)) != 0 ? "x" : ".");
  return marks;
}

std::vector<std::string> joined(std::vector<std::string> first, const std::vector<std::string>& then) {
  first.insert(first.end(), then.begin(), then.end());
  return first;
}

TEST(EffectsTable, hasTheSetsFromTheCheapestOnAndWhatEachEffectAdds) {
  constexpr EffectMask kCut = bitOf(Effect::kCutting), kClamp = bitOf(Effect::kClamping);
  std::vector<EffectSetCost> sets = {cost(kCut | kClamp, 15.04, 190.21), cost(kCut, 9, 130), cost(0, 7, 100),
                                     cost(kClamp, 10)};
  sets[0].timing.p99_ns = 20;
  sets[0].timing.batches = 400;
  sets[0].timing.per_batch = 64;
  const auto lines = tableLines(effectsTable(sets));
  ASSERT_EQ(lines.size(), 13u);
  EXPECT_EQ(lines[0], "layers");
  EXPECT_EQ(wordsOf(lines[2]), joined(marksOf(0), {"7.0", "0.0", "0.0", "100.0"}));
  EXPECT_EQ(wordsOf(lines[3]), joined(marksOf(kCut), {"9.0", "0.0", "2.0", "130.0"}));
  EXPECT_EQ(wordsOf(lines[4]), joined(marksOf(kClamp), {"10.0", "0.0", "3.0", "-"}));
  EXPECT_EQ(wordsOf(lines[5]), joined(marksOf(kCut | kClamp), {"15.0", "20.0", "8.0", "190.2"}));
  EXPECT_EQ(lines[6], "");
  EXPECT_EQ(lines[7], "what an effect adds, to no other and to all others");
  // cutting: 9 − 7 and 15.04 − 10; clamping: 10 − 7 and 15.04 − 9; in one pair of each a count is missing
  EXPECT_EQ(wordsOf(lines[9]), (std::vector<std::string>{"cutting", "3.5", "2.0", "5.0", "-"}));
  EXPECT_EQ(wordsOf(lines[10]), (std::vector<std::string>{"clamping", "4.5", "3.0", "6.0", "-"}));
  EXPECT_THAT(lines[12], HasSubstr("median and p99 of 400 batches of 64 ticks"));
}

TEST(EffectsTable, itsFilesHaveTheSameNumbers) {
  constexpr EffectMask kCut = bitOf(Effect::kCutting);
  const TempFolder folder;
  const std::string path = std::getenv("PATH");
  ::setenv("PATH", folder.path().c_str(), 1);  // gnuplot is missing
  const Status drawn = drawEffects({cost(kCut, 9.25), cost(0, 7.5)}, folder.path());
  ::setenv("PATH", path.c_str(), 1);
  ASSERT_TRUE(drawn.ok()) << drawn.error().message;
  const auto sets = readCsv(folder.path() / "effects.csv", {"count", "median_ns", "p99_ns", "cutting"});
  ASSERT_TRUE(sets.ok()) << sets.error().message;
  EXPECT_EQ(sets->columns, (std::vector<std::vector<double>>{{0, 1}, {7.5, 9.25}, {0, 0}, {0, 1}}));
  std::ifstream file(folder.path() / "effects_marginal.csv");
  std::stringstream text;
  text << file.rdbuf();
  EXPECT_EQ(text.str(), "place,mean_ns,least_ns,most_ns,effect,scene\n0,1.75,1.75,1.75,cutting,layers\n");
}

// times order these sets the other way: the picture uses what is reproducible
TEST(EffectsPicture, showsInstructionsWhereTheyWereCounted) {
  constexpr EffectMask kCut = bitOf(Effect::kCutting), kClamp = bitOf(Effect::kClamping);
  const TempFolder folder;
  const Status drawn =
      drawEffects({cost(0, 9, 100), cost(kCut, 8, 130), cost(kClamp, 7, 150), cost(kCut | kClamp, 6, 190)},
                  folder.path());
  ASSERT_TRUE(drawn.ok()) << drawn.error().message;
  const auto sets = readCsv(folder.path() / "effects.csv", {"cost_instructions", "median_ns"});
  ASSERT_TRUE(sets.ok()) << sets.error().message;
  EXPECT_EQ(sets->columns, (std::vector<std::vector<double>>{{100, 130, 150, 190}, {9, 8, 7, 6}}));
  std::ifstream file(folder.path() / "effects_marginal.csv");
  std::stringstream text;
  text << file.rdbuf();
  EXPECT_EQ(
      text.str(),
      "place,mean_instructions,least_instructions,most_instructions,effect,scene\n0,35,30,40,cutting,layers\n"
      "2,55,50,60,clamping,layers\n");
}

TEST(EffectsCommand, givesOneRowForEachSet) {
  const TempFolder folder;
  const auto file = (folder.path() / "effects.json").string();
  const Outcome run = sim({"effects", "--no-instructions", "--rate", "250", "--json", file});
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("what an effect adds"));
  const auto json = nlohmann::json::parse(std::ifstream(file));
  EXPECT_TRUE(json.contains("version"));
  EXPECT_TRUE(json.contains("machine"));
  // of nine effects of a needle none, each, all but each, all; the cap's alone. The body has no CUT_MEMORY
  ASSERT_EQ(json["rows"].size(), (2 + 2 * 9 + 1) + (2 + 2 * 8 + 1u));
  std::map<std::string, std::set<std::set<std::string>>> sets;
  for (const auto& row : json["rows"]) {
    EXPECT_TRUE(row["median_ns"].is_number() && row["p99_ns"].is_number());
    EXPECT_EQ(row["instructions"], nullptr);
    const auto names = row["effects"].get<std::vector<std::string>>();
    if (names.size() > 1) {
      EXPECT_EQ(std::count(names.begin(), names.end(), "PALPATION"), 0);
    }
    sets[row["scene"]].insert({names.begin(), names.end()});
  }
  EXPECT_EQ(sets["six layers"].size(), 21u) << "each set once";
  EXPECT_EQ(sets["shoulder-median"].size(), 19u);
}

TEST(EffectsCommand, aProfilesSetsAreThoseOfItsLiveEffects) {
  const Outcome run =
      sim({"effects", "--no-instructions", "--json", "--profile", NEEDLELAB_SAMPLES "/paper-1dof.json"});
  ASSERT_EQ(run.code, 0) << run.err;
  const auto rows = nlohmann::json::parse(run.out)["rows"];
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_EQ(rows[0]["effects"], nlohmann::json::array());
  EXPECT_EQ(rows[3]["effects"], (nlohmann::json{"CUTTING", "ATTRACTED"}));
}

TEST(EffectsCommand, drawsItsTable) {
  const TempFolder folder;
  const Outcome run = sim({"effects", "--no-instructions", "--profile", NEEDLELAB_SAMPLES "/paper-1dof.json",
                           "--out", (folder.path() / "made").string()});
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "made/effects.csv"));
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "made/effects_marginal.csv"));
  if (!hasGnuplot()) GTEST_SKIP() << "gnuplot is not there: no picture";
  EXPECT_GT(std::filesystem::file_size(folder.path() / "made/effects.png"), 5000u);
}

TEST(EffectsCommand, badInputNamesFileOrValueAndIsNumberTwo) {
  const TempFolder folder;
  EXPECT_EQ(sim({"effects", "--profile", "nowhere.json"}).code, 2);
  EXPECT_THAT(sim({"effects", "--profile", "nowhere.json"}).err, HasSubstr("nowhere.json"));
  const Outcome rate = sim({"effects", "--no-instructions", "--rate", "10"});
  EXPECT_EQ(rate.code, 2);
  EXPECT_THAT(rate.err, HasSubstr("[50, 40000]"));
  EXPECT_EQ(sim({"effects", "--instructions", "--no-instructions"}).code, 2);
}

/// The rows of the real program, which runs itself under callgrind. Empty: it failed.
nlohmann::json countedRows(const std::string& profile) {
  const TempFolder folder;
  const auto file = (folder.path() / "effects.json").string();
  const std::string command = std::string(NEEDLELAB_SIM) +
                              " effects --instructions --rate 250 --profile " NEEDLELAB_SAMPLES "/" +
                              profile + " --json " + file + " > /dev/null";
  if (std::system(command.c_str()) != 0) return {};
  return nlohmann::json::parse(std::ifstream(file))["rows"];
}

TEST(EffectsCommand, countsInstructionsWhereValgrindIs) {
  if (kSanitized) GTEST_SKIP() << "valgrind cannot run a program built with a sanitizer";
  if (!hasValgrind()) GTEST_SKIP() << "valgrind is not on the PATH (Debian: valgrind)";
  const auto rows = countedRows("paper-1dof.json");
  ASSERT_EQ(rows.size(), 4u);
  for (const auto& row : rows) EXPECT_GT(row["instructions"].get<double>(), 50);
  EXPECT_GT(rows[3]["instructions"], rows[0]["instructions"]);
}

// In a body the tick needs a path: the model of the body alone steps nothing, and all of its sets cost the
// same.
TEST(EffectsCommand, countsTheTicksOfABodyOnItsPathAndOfTheCap) {
  if (kSanitized) GTEST_SKIP() << "valgrind cannot run a program built with a sanitizer";
  if (!hasValgrind()) GTEST_SKIP() << "valgrind is not on the PATH (Debian: valgrind)";
  const auto rows = countedRows("volumes/shoulder-median.json");
  ASSERT_FALSE(rows.empty());
  std::map<std::set<std::string>, double> counted;
  for (const auto& row : rows) {
    const auto names = row["effects"].get<std::vector<std::string>>();
    counted[{names.begin(), names.end()}] = row["instructions"];
  }
  EXPECT_GT(counted[{"CUTTING"}], counted[{}]);
  EXPECT_GT(counted[{"CLAMPING"}], counted[{}]);
  EXPECT_GT(counted[{"BONE"}], counted[{}]);
  EXPECT_NE(counted[{"PALPATION"}], counted[{}]);
}

}  // namespace
}  // namespace needlelab::test
