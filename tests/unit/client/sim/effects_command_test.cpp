#include <gmock/gmock.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "client/effect_cost/instruction_count.h"
#include "client/sim/effects_study.h"
#include "client/sim/tools/gnuplot.h"
#include "tests/support/sanitized.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/sim/sim_run.h"

namespace needlelab::test {
namespace {

using ::testing::HasSubstr;

EffectSetCost cost(EffectMask effects, double ns, std::optional<double> instructions = {}) {
  EffectSetCost made;
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
  EXPECT_DOUBLE_EQ(costs[0].least_ns, 2);
  EXPECT_DOUBLE_EQ(costs[0].most_ns, 5);
  EXPECT_DOUBLE_EQ(*costs[0].instructions, 35);
  EXPECT_EQ(costs[1].effect, Effect::kClamping);
  EXPECT_DOUBLE_EQ(costs[1].mean_ns, 4.5);
}

TEST(MarginalCosts, areNotCountedWhereACountIsMissing) {
  const auto costs = marginalCosts({cost(0, 7), cost(1, 9, 130)});
  ASSERT_EQ(costs.size(), 1u);
  EXPECT_FALSE(costs[0].instructions);
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
  ASSERT_EQ(json["rows"].size(), kAllEffects + 1);
  std::set<std::set<std::string>> sets;
  for (const auto& row : json["rows"]) {
    EXPECT_TRUE(row["median_ns"].is_number() && row["p99_ns"].is_number());
    EXPECT_EQ(row["instructions"], nullptr);
    const auto names = row["effects"].get<std::vector<std::string>>();
    sets.insert({names.begin(), names.end()});
  }
  EXPECT_EQ(sets.size(), kAllEffects + 1) << "each set once";
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

// The program itself, which runs itself again under callgrind.
TEST(EffectsCommand, countsInstructionsWhereValgrindIs) {
  if (kSanitized) GTEST_SKIP() << "valgrind cannot run a program built with a sanitizer";
  if (!hasValgrind()) GTEST_SKIP() << "valgrind is not on the PATH (Debian: valgrind)";
  const TempFolder folder;
  const auto file = (folder.path() / "effects.json").string();
  const std::string command = std::string(NEEDLELAB_SIM) +
                              " effects --instructions --rate 250 --profile " NEEDLELAB_SAMPLES
                              "/paper-1dof.json --json " +
                              file + " > /dev/null";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const auto rows = nlohmann::json::parse(std::ifstream(file))["rows"];
  ASSERT_EQ(rows.size(), 4u);
  for (const auto& row : rows) EXPECT_GT(row["instructions"].get<double>(), 50);
  EXPECT_GT(rows[3]["instructions"], rows[0]["instructions"]);
}

}  // namespace
}  // namespace needlelab::test
