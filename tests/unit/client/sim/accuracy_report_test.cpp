/// Tests the accuracy report on made-up rows: front, tables, CSV, JSON, recommendation, scripts for the
/// pictures.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "client/sim/accuracy/panel_layout.h"
#include "client/sim/accuracy/recommendation.h"
#include "client/sim/accuracy/report.h"
#include "client/sim/tools/hand_thresholds.h"
#include "tests/unit/client/sim/accuracy_rows.h"

namespace needlelab {
namespace {

using test::liveRow;
using test::modelRow;
using test::rateRow;
using test::storageRow;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

TEST(ParetoFront, holdsWhatNothingBeatsInBothMeasures) {
  EXPECT_THAT(paretoFront(std::vector<CostError>{{1, 5}, {2, 3}, {3, 4}, {4, 1}, {2, 6}}),
              ElementsAre(true, true, false, true, false));
}

TEST(ParetoFront, equalPointsAreOnItTogetherAndTiesInOneMeasureAreNot) {
  EXPECT_THAT(paretoFront(std::vector<CostError>{{1, 1}, {1, 1}, {1, 2}, {2, 1}}),
              ElementsAre(true, true, false, false));
}

TEST(ParetoFront, whatWasNotMeasuredIsNotOnItAndBeatsNothing) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(paretoFront(std::vector<CostError>{{nan, 0}, {1, 1}, {0, nan}}),
              ElementsAre(false, true, false));
}

TEST(ParetoFront, aDifferenceWithinTheNoiseOfTheRunsDecidesNothing) {
  // cost, error, least, greatest: 100 and 104 overlap, so the smaller error alone is on the front
  EXPECT_THAT(paretoFront(std::vector<CostError>{{100, 3, 95, 106}, {104, 2, 98, 110}}),
              ElementsAre(false, true));
  // the same medians with narrow runs: both are
  EXPECT_THAT(paretoFront(std::vector<CostError>{{100, 3, 99, 101}, {104, 2, 103, 105}}),
              ElementsAre(true, true));
  // equal errors within the noise: both
  EXPECT_THAT(paretoFront(std::vector<CostError>{{100, 2, 95, 106}, {104, 2, 98, 110}}),
              ElementsAre(true, true));
}

TEST(ParetoFront, instructionsBreakTheTiesOfTime) {
  EXPECT_THAT(paretoFront(std::vector<CostError>{{100, 2, 95, 106, 210}, {104, 2, 98, 110, 190}}),
              ElementsAre(false, true));
  EXPECT_THAT(paretoFront(std::vector<CostError>{{100, 2, 99, 101, 210}, {104, 2, 103, 105, 190}}),
              ElementsAre(true, false))
      << "where time decides, they do not";
  EXPECT_TRUE(costsLess({104, 0, 98, 110, 190}, {100, 0, 95, 106, 210}));
  EXPECT_FALSE(costsLess({100, 0, 95, 106}, {104, 0, 98, 110, 190})) << "one of them was not counted";
}

TEST(AccuracyGroups, rowsOfAnotherReferenceOrSceneAreNotCompared) {
  AccuracyRows rows = {modelRow("A", 1, 1), modelRow("B", 2, 2), modelRow("C", 3, 3), modelRow("D", 4, 4)};
  rows[1].reference = "another";
  rows[2].scene = "another";
  const auto groups = groupsOf(rows);
  ASSERT_EQ(groups.size(), 3u);
  EXPECT_EQ(groups[0].rows.size(), 2u);
  EXPECT_EQ(groups[0].rows[1]->model, "D");
}

TEST(AccuracyGroups, aRatesCostIsItsShareOfACoreInAMillisecond) {
  EXPECT_DOUBLE_EQ(costOf_ns(rateRow(4000, 0.1, 2))->value, 400);
  EXPECT_DOUBLE_EQ(costOf_ns(modelRow("A", 0.1, 30))->value, 30);
  // the price of a tick four times in a millisecond, with its runs
  AccuracyRow row = rateRow(4000, 0.1, 2);
  setCost(row, test::costOf(120, 100, 150), 4000);
  EXPECT_DOUBLE_EQ(costOf_ns(row)->value, 480);
  EXPECT_DOUBLE_EQ(costOf_ns(row)->low, 400);
  EXPECT_DOUBLE_EQ(costOf_ns(row)->high, 600);
  EXPECT_FALSE(costOf_ns(AccuracyRow{}));
}

TEST(AccuracyTable, saysComparatorUncertaintyAndWhatItCannotShow) {
  AccuracyRows rows = {modelRow("SLOW", 0.01, 2e6, false), modelRow("QUICK", 0.5, 20)};
  const std::string text = accuracyTables(rows);
  EXPECT_THAT(text, HasSubstr("against: a made-up force"));
  EXPECT_THAT(text, HasSubstr("cannot show: anything"));
  EXPECT_THAT(text, HasSubstr("NO"));
  EXPECT_THAT(text, HasSubstr("rms error [N]"));
  EXPECT_THAT(text, Not(HasSubstr("bytes/sample"))) << "no row of the group has it";
}

TEST(AccuracyTable, aLimitThatHoldsForSomeRowsNamesThem) {
  AccuracyRows rows = {modelRow("A", 0.1, 10), modelRow("B", 0.2, 20)};
  rows[0].cannot_show = "cutting. It is its own copy";
  rows[1].cannot_show = "cutting";
  const std::string text = accuracyTables(rows);
  EXPECT_THAT(text, HasSubstr("cannot show: cutting\n"));
  EXPECT_THAT(text, HasSubstr("cannot show, A: It is its own copy"));
}

TEST(AccuracyTable, hasThePriceItsRunsAndTheTailsBesideAnEmptyCalls) {
  AccuracyRows rows = {modelRow("A", 0.1, 10), modelRow("B", 0.2, 20)};
  TickCost cost = test::costOf(880, 800, 999);
  cost.slept = {310, 700, 900};
  cost.slept_empty = {60, 90, 120};
  for (AccuracyRow& row : rows) setCost(row, cost, 1000);
  const std::string text = accuracyTables(rows);
  EXPECT_THAT(text, HasSubstr("price [ns]"));
  EXPECT_THAT(text, HasSubstr("800–999"));
  EXPECT_THAT(text, HasSubstr("310/700/900 (60/90/120)"));
}

TEST(AccuracyTable, columnsAlignWhateverTheLettersBytes) {
  AccuracyRows rows = {storageRow(1e-6, 0.1, 3), storageRow(0, 0, 40)};
  std::vector<std::size_t> at;
  std::istringstream lines(accuracyTables(rows));
  for (std::string line; std::getline(lines, line);)
    for (const std::string mark : {"none", "uncertainty"}) {
      const auto found = line.find(mark);
      if (found == std::string::npos) continue;
      // counts letters, not bytes
      std::size_t letters = 0;
      for (std::size_t i = 0; i < found; ++i)
        letters += (static_cast<unsigned char>(line[i]) & 0xC0u) != 0x80u;
      at.push_back(letters);
    }
  ASSERT_EQ(at.size(), 3u);
  EXPECT_EQ(at[0], at[1]);
  EXPECT_EQ(at[1], at[2]);
}

TEST(AccuracyJson, hasTheColumnsOfTheDesignAndNullWhereAStudyUsesNone) {
  const auto json = jsonOf(modelRow("VOIGT", 0.25, 20));
  for (const char* key : {"study", "scene", "model", "rate_hz", "mesh_nodes", "quantum_m", "frame_s",
                          "reference", "rms_error_n", "max_error_n", "bytes_per_sample", "latency_ms",
                          "cpu_share", "median_ns", "p99_ns", "fits_rate", "uncertainty", "cannot_show"})
    EXPECT_TRUE(json.contains(key)) << key;
  EXPECT_EQ(json["study"], "model");
  EXPECT_EQ(json["rms_error_n"], 0.25);
  EXPECT_TRUE(json["quantum_m"].is_null());
  EXPECT_EQ(json["fits_rate"], true);
  EXPECT_TRUE(json["cost_ns"].is_null());
  AccuracyRow timed = modelRow("VOIGT", 0.25, 20);
  setCost(timed, test::costOf(880, 800, 999), 1000);
  EXPECT_EQ(jsonOf(timed)["cost_ns"], 880);
  EXPECT_EQ(jsonOf(timed)["cost_high_ns"], 999);
  for (const char* kind : {"hot", "hot_empty", "flushed", "flushed_empty", "slept", "slept_empty"})
    for (const char* quantile : {"_p50_ns", "_p99_ns", "_p999_ns"})
      EXPECT_TRUE(jsonOf(timed).contains(std::string(kind) + quantile)) << kind << quantile;
}

TEST(AccuracyJson, whatIsNotFiniteIsNull) {
  AccuracyRow row = modelRow("FEM", std::numeric_limits<double>::infinity(), 20);
  EXPECT_TRUE(jsonOf(row)["rms_error_n"].is_null());
}

TEST(AccuracyCsv, everyRowHasAsManyCellsAsTheHeader) {
  AccuracyRow row = modelRow("A", 1, 1);
  row.cannot_show = "words, with a comma and \"quotes\"";
  const std::string csv = accuracyCsv({row});
  EXPECT_THAT(csv, HasSubstr("\"words, with a comma and \"\"quotes\"\"\""));
  const auto cells = [](const std::string& line) {
    std::size_t count = 1;
    bool quoted = false;
    for (const char c : line) {
      if (c == '"') quoted = !quoted;
      count += c == ',' && !quoted;
    }
    return count;
  };
  const auto end = csv.find('\n');
  EXPECT_EQ(cells(csv.substr(0, end)), cells(csv.substr(end + 1)));
  EXPECT_EQ(csv.rfind("study,scene,model", 0), 0u);
}

std::string adviceOf(const AccuracyRows& rows) {
  return adviceFor(groupsOf(rows).front()).text;
}

TEST(Recommendation, takesTheCheapestModelWhoseErrorNobodyNotices) {
  EXPECT_THAT(
      adviceOf({modelRow("CHEAP", 0.5, 10), modelRow("GOOD", 0.15, 20), modelRow("BETTER", 0.05, 500)}),
      HasSubstr("take GOOD"));
}

TEST(Recommendation, changesWhenTheRowsChange) {
  // The same rows, but now the cheap model is accurate enough.
  EXPECT_THAT(adviceOf({modelRow("CHEAP", 0.1, 10), modelRow("GOOD", 0.15, 20)}), HasSubstr("take CHEAP"));
  // the cheap one steps: a step is felt, whatever the mean error
  AccuracyRows rows = {modelRow("CHEAP", 0.1, 10), modelRow("GOOD", 0.15, 20)};
  rows[0].max_step_n = 1;
  EXPECT_THAT(adviceOf(rows), HasSubstr("take GOOD"));
  // If the good model is too slow, none is good enough: the report names the smallest error that is fast
  // enough, and does not recommend it.
  rows[1].fits_rate = false;
  EXPECT_THAT(adviceOf(rows), HasSubstr("none can be recommended; the nearest is CHEAP"));
  EXPECT_THAT(adviceOf(rows), HasSubstr("none is below"));
  EXPECT_THAT(adviceOf(rows), HasSubstr("Too slow for their rate: GOOD"));
}

// 0.175 N is what a hand notices of a force that it compares; a step of 0.05 N beside it is felt all the same
TEST(Recommendation, aStepInTimeIsJudgedByItsOwnThreshold) {
  AccuracyRows rows = {modelRow("CHEAP", 0.1, 10), modelRow("GOOD", 0.15, 20)};
  rows[0].max_step_n = 0.05;
  rows[1].max_step_n = 0.02;
  EXPECT_THAT(adviceOf(rows), HasSubstr("take GOOD"));
  EXPECT_THAT(adviceOf(rows), HasSubstr("(0.2 N; a step in time: 0.021 N)"));
  rows[0].max_step_n = 0.02;
  EXPECT_THAT(adviceOf(rows), HasSubstr("take CHEAP"));
  AccuracyRow slow = rateRow(250, 0.01, 3), fast = rateRow(1000, 0.001, 3);
  slow.max_step_n = 0.075;
  EXPECT_GT(missOf(slow), 1);
  EXPECT_LE(missOf(fast), 1);
}

TEST(Recommendation, aChoicePassesWhenItsIntervalDoes) {
  AccuracyRows rows = {modelRow("CHEAP", 0.15, 10), modelRow("DEAR", 0.1, 20)};
  rows[0].rms_error_spread_n = 0.04;
  EXPECT_THAT(adviceOf(rows), HasSubstr("take CHEAP")) << "0.19 N of 0.2 N";
  rows[0].rms_error_spread_n = 0.06;
  EXPECT_THAT(adviceOf(rows), HasSubstr("take DEAR")) << "0.15 ± 0.06 N reaches above 0.2 N";
}

TEST(Recommendation, saysByHowMuchItsCriterionIsMissed) {
  AccuracyRows rows = {modelRow("A", 0.75, 10), modelRow("B", 0.9, 20)};
  EXPECT_DOUBLE_EQ(missOf(rows[0]), 3.75);
  EXPECT_THAT(adviceOf(rows), HasSubstr("none can be recommended; the nearest is A"));
  EXPECT_THAT(adviceOf(rows), HasSubstr("3.8 times the limit"));
  EXPECT_THAT(findingOf(AccuracyStudy::kModel, rows),
              HasSubstr("None passes: A comes nearest, 3.8 times the limit"));
  rows[0].rms_error_n = 0.1;
  rows[0].max_step_n = 1;
  EXPECT_DOUBLE_EQ(missOf(rows[0]), 1 / kNoticeableStep_N) << "the step, which is felt whatever the error";
  EXPECT_DOUBLE_EQ(missOf(rateRow(1000, 0.1, 0.5)), 4) << "twice the stiffness, half of it allowed";
}

TEST(Recommendation, whatMetNoConditionDoesNotVote) {
  AccuracyRows rows = {modelRow("A", 0.75, 10), modelRow("B", 0.9, 20), modelRow("A", 0.5, 10),
                       modelRow("B", 0.1, 20),  modelRow("A", 0.6, 10), modelRow("B", 0.9, 20)};
  rows[2].scene = rows[3].scene = "second";
  rows[4].scene = rows[5].scene = "third";
  const std::string sum = recommendation(rows).back();
  EXPECT_THAT(sum, HasSubstr("the model B")) << "A is nearer twice, but never near enough";
  EXPECT_THAT(sum, Not(HasSubstr("frequent"))) << "one comparison alone voted";
  rows[3].rms_error_n = 0.9;
  EXPECT_THAT(recommendation(rows).back(), HasSubstr("no model can be recommended"));
  EXPECT_THAT(recommendation(rows).back(), Not(HasSubstr("the model A")));
}

TEST(Recommendation, aModelAgainstItsOwnLawIsShownAndDoesNotVote) {
  AccuracyRows rows = {modelRow("FEM", 0.01, 100), modelRow("OTHER", 0.15, 200)};
  rows[0].own_law = true;
  EXPECT_THAT(adviceOf(rows), HasSubstr("take OTHER"));
  EXPECT_THAT(adviceOf(rows),
              HasSubstr("Shown only, because the comparator contains their own law: FEM (0.01 N)"));
  EXPECT_EQ(jsonOf(rows[0])["votes"], false);
  EXPECT_EQ(jsonOf(rows[1])["votes"], true);
  rows[1].own_law = true;
  EXPECT_FALSE(adviceFor(groupsOf(rows).front()).votes());
  EXPECT_THAT(adviceOf(rows), HasSubstr("nothing to choose from"));
  EXPECT_THAT(accuracyTables(rows), HasSubstr("own law"));
}

// two runs of the program: other times within their noise, the same choice
TEST(Recommendation, twoRunsWithTheSameErrorsRecommendTheSame) {
  const auto run = [](double a_ns, double b_ns) {
    AccuracyRows rows = {modelRow("A", 0.15, 0), modelRow("B", 0.12, 0), modelRow("C", 0.05, 0)};
    setCost(rows[0], test::costOf(a_ns, a_ns - 30, a_ns + 30), 1000);
    setCost(rows[1], test::costOf(b_ns, b_ns - 30, b_ns + 30), 1000);
    setCost(rows[2], test::costOf(5000, 4900, 5100), 1000);
    rows[0].instructions = 300;
    rows[1].instructions = 250;
    rows[2].instructions = 2500;
    return adviceFor(groupsOf(rows).front()).row->model;
  };
  EXPECT_EQ(run(500, 520), "B") << "within the noise the fewer instructions decide";
  EXPECT_EQ(run(520, 500), "B");
  EXPECT_EQ(run(400, 500), "A") << "beyond it the time decides";
}

TEST(Recommendation, saysWhenNothingFits) {
  const Advice advice = adviceFor({AccuracyStudy::kModel, "scene", "reference", "", {}, {}});
  EXPECT_EQ(advice.row, nullptr);
  EXPECT_THAT(adviceOf({modelRow("A", 0.1, 2e6, false)}), HasSubstr("no choice can be recommended"));
}

TEST(Recommendation, aRateNeedsTwiceTheScenesStiffness) {
  EXPECT_THAT(adviceOf({rateRow(250, 0.01, 0.6), rateRow(500, 0.01, 1.1), rateRow(1000, 0.01, 2.3)}),
              HasSubstr("take 1 kHz"));
  EXPECT_THAT(adviceOf({rateRow(250, 0.01, 2.6), rateRow(500, 0.01, 5.1)}), HasSubstr("take 250 Hz"));
}

TEST(Recommendation, storageTakesTheFewestBytesBelowATenthOfWhatIsNoticed) {
  EXPECT_THAT(adviceOf({storageRow(0, 0, 40), storageRow(1e-6, 0.001, 3), storageRow(1e-5, 0.019, 2),
                        storageRow(1e-4, 0.021, 1)}),
              HasSubstr("take 10 µm"));
}

TEST(Recommendation, liveFramesMustLeaveHalfTheTimeToTheNetwork) {
  EXPECT_THAT(adviceOf({liveRow(0.005, 5, 34e3), liveRow(0.02, 20, 11e3), liveRow(0.05, 50, 7e3)}),
              HasSubstr("take 20 ms"));
  EXPECT_THAT(adviceOf({liveRow(0.05, 50, 7e3), liveRow(0.2, 200, 4e3)}),
              HasSubstr("none has a p99 latency"));
}

TEST(Recommendation, theSumTakesTheMostCarefulChoiceOfSeveralScenes) {
  AccuracyRows rows = {storageRow(1e-6, 0.001, 3), storageRow(1e-5, 0.01, 2), storageRow(1e-6, 0.001, 3),
                       storageRow(1e-5, 0.5, 2)};
  rows[2].scene = rows[3].scene = "another scene";
  EXPECT_THAT(recommendation(rows).back(),
              HasSubstr("stored steps of 1 µm (the most careful choice, in 1 of 2"));
  EXPECT_TRUE(recommendation({}).empty());
}

TEST(Recommendation, oneChoiceAloneIsNotRecommended) {
  AccuracyRows rows = {modelRow("A", 0.1, 10), modelRow("A", 0.05, 10)};
  rows[1].variant = "fitted";
  const Advice advice = adviceFor(groupsOf(rows).front());
  EXPECT_FALSE(advice.is_choice);
  EXPECT_THAT(advice.text, HasSubstr("nothing to choose from"));
  EXPECT_THAT(recommendation(rows), testing::SizeIs(1)) << "and no sum";
}

TEST(Recommendation, scenesWithTheSameChoiceShareAParagraph) {
  AccuracyRows rows = {storageRow(1e-6, 0.001, 3), storageRow(1e-5, 0.01, 2), storageRow(1e-6, 0.001, 3),
                       storageRow(1e-5, 0.012, 2)};
  rows[2].scene = rows[3].scene = "second scene";
  const auto paragraphs = recommendation(rows);
  ASSERT_EQ(paragraphs.size(), 2u);
  EXPECT_THAT(paragraphs[0], HasSubstr("The same choice in second scene (rms error 0.012 N"));
}

AccuracyRow meshRow(double nodes, double error_n, double median_ns) {
  AccuracyRow row = modelRow("FEM", error_n, median_ns);
  row.study = AccuracyStudy::kMesh;
  row.mesh_nodes = nodes;
  row.fits_rate = median_ns < 1e6;
  return row;
}

TEST(Recommendation, takesTheCoarsestMeshThatIsGoodEnoughAndNamesTheLargestThatFits) {
  const AccuracyRows rows = {meshRow(500, 0.4, 1e3), meshRow(2000, 0.15, 2e3), meshRow(9000, 0.05, 9e5),
                             meshRow(20'000, 0.01, 2e6), meshRow(50'000, 0, 4e6)};
  EXPECT_THAT(adviceOf(rows), HasSubstr("take 2,000 nodes"));
  EXPECT_THAT(adviceOf(rows), HasSubstr("The largest mesh tried that fits its rate: 9,000 nodes."));
  EXPECT_THAT(adviceOf(rows), HasSubstr("Too slow for their rate: 20,000 nodes and 50,000 nodes."));
}

// each mesh made before the lesson, then each of them solved in each tick
AccuracyRows meshesBothWays() {
  AccuracyRows rows = {meshRow(2000, 0.3, 300),   meshRow(9000, 0.05, 310), meshRow(50'000, 0, 305),
                       meshRow(2000, 0.3, 3.6e5), meshRow(9000, 0.05, 2e7), meshRow(50'000, 0, 6e7)};
  for (std::size_t i = 0; i < rows.size(); ++i)
    rows[i].variant = i < 3 ? "compliance made before" : "solved in each tick";
  rows[0].precompute_s = 0.06;
  rows[1].precompute_s = 0.5;
  rows[2].precompute_s = 5;
  return rows;
}

TEST(AccuracyGroups, aMeshMadeBeforeTheLessonHasItsSecondsAsItsPrice) {
  const AccuracyRows rows = meshesBothWays();
  const auto groups = groupsOf(rows);
  ASSERT_EQ(groups.size(), 2u) << "seconds before a lesson and in each tick are not one price";
  EXPECT_DOUBLE_EQ(costOf_ns(*groups[0].rows[1])->value, 0.5e9);
  EXPECT_DOUBLE_EQ(costOf_ns(*groups[1].rows[1])->value, 2e7);
  EXPECT_THAT(paretoFront(groups[0]), ElementsAre(true, true, false)) << "their ticks are equal";
  EXPECT_EQ(jsonOf(rows[1])["precompute_s"], 0.5);
  EXPECT_TRUE(jsonOf(rows[4])["precompute_s"].is_null());
  EXPECT_THAT(accuracyTables(rows), HasSubstr("made in [s]"));
}

TEST(Recommendation, saysWhatAMeshCostsBeforeTheLesson) {
  const AccuracyRows rows = meshesBothWays();
  const auto paragraphs = recommendation(rows);
  ASSERT_EQ(paragraphs.size(), 3u);
  EXPECT_THAT(paragraphs[0], HasSubstr("mesh, made-up scene, compliance made before (against"));
  EXPECT_THAT(paragraphs[0], HasSubstr("take 9,000 nodes"));
  EXPECT_THAT(paragraphs[0], HasSubstr("made in 0.5 s before the lesson, then 310 ns (p99 620 ns) a tick"));
  EXPECT_THAT(paragraphs[1], HasSubstr("solved in each tick (against"));
  EXPECT_THAT(paragraphs[1],
              HasSubstr("none can be recommended; the nearest is 2,000 nodes: none that fits"));
  EXPECT_THAT(paragraphs[2], HasSubstr("an FEM mesh of 9,000 nodes."));
  EXPECT_THAT(findingOf(AccuracyStudy::kMesh, rows),
              HasSubstr("0.05 N of error for 500 ms before the lesson"));
}

TEST(AccuracyPictures, meshesHaveAPanelForEachWayWithItsOwnPrice) {
  const auto pictures = accuracyPictures(meshesBothWays());
  ASSERT_EQ(pictures.size(), 1u);
  EXPECT_THAT(pictures[0].data, HasSubstr("time to make the mesh, once, before the lesson"));
  EXPECT_THAT(pictures[0].data, HasSubstr("time of a tick (median to p99, hot)"));
  EXPECT_THAT(pictures[0].data, HasSubstr("compliance made before, made-up scene, against"));
}

// an error whose comparator is itself uncertain passes when the upper end does
TEST(Recommendation, aMeshPassesWithWhatTheFinestMissesItself) {
  AccuracyRow row = meshRow(2000, 0.15, 300);
  row.rms_error_spread_n = 0.04;
  EXPECT_LE(missOf(row), 1);
  row.rms_error_spread_n = 0.06;
  EXPECT_GT(missOf(row), 1);
}

TEST(ParetoFront, ratesWithinTheNoiseAreOrderedByTheirTicks) {
  AccuracyRows rows = {rateRow(1000, 0.1, 2), rateRow(2000, 0.05, 2)};
  // 500 to 1,500 and 1,000 to 3,000 ns in a millisecond
  for (AccuracyRow& row : rows) setCost(row, test::costOf(1000, 500, 1500), *row.rate_hz);
  EXPECT_THAT(paretoFront(groupsOf(rows).front()), ElementsAre(true, true));
}

TEST(ParetoFront, meshesWhoseTicksOverlapDifferByTheirErrorAlone) {
  AccuracyRows rows = {meshRow(500, 0.4, 160), meshRow(2000, 0.15, 170), meshRow(50'000, 0, 165)};
  EXPECT_THAT(paretoFront(groupsOf(rows).front()), ElementsAre(false, true, false))
      << "p99 is twice the median";
}

TEST(ParetoFront, theFinestMeshIsTheComparatorNotAChoice) {
  const AccuracyRows rows = {meshRow(500, 0.4, 1e3), meshRow(2000, 0.15, 3e3), meshRow(50'000, 0, 900)};
  EXPECT_THAT(paretoFront(groupsOf(rows).front()), ElementsAre(true, true, false));
}

TEST(SiText, keepsThreeFiguresAndNeverAThousand) {
  EXPECT_EQ(siText(2e-8, "s"), "20 ns");
  EXPECT_EQ(siText(0.00123456, "N"), "0.00123 N");
  EXPECT_EQ(siText(9.999e-7, "s"), "1 µs");
  EXPECT_EQ(siText(3e5, "B/s"), "300 kB/s");
  EXPECT_EQ(siText(0, "N"), "0 N");
}

TEST(NewtonText, staysInNewtonsWithoutPowersOfTen) {
  EXPECT_EQ(newtonText(0.0087, 2), "0.0087 N");
  EXPECT_EQ(newtonText(1.234e-6, 2), "0.0000012 N");
  EXPECT_EQ(newtonText(9.999e-4, 3), "0.001 N");
  EXPECT_EQ(newtonText(12.34, 2), "12 N");
  EXPECT_EQ(newtonText(123.4, 2), "123 N");
  EXPECT_EQ(newtonText(0.5, 2), "0.5 N");
  EXPECT_EQ(newtonText(0, 2), "0 N");
}

TEST(LabelLayout, namesCoverNeitherEachOtherNorAPoint) {
  // nine clustered points, like models with the same cost
  std::vector<PixelPoint> points;
  std::vector<std::string> labels;
  for (int i = 0; i < 9; ++i) {
    points.push_back({400.0 + 6 * (i % 3), 300.0 + 9 * (i / 3)});
    labels.push_back("ENHANCED_TRACKING_WALL");
  }
  const LabelSpace space{{0, 0, 800, 600}, {}, 8, 15};
  const auto placed = placeLabels(points, labels, space);
  ASSERT_EQ(placed.size(), 9u);
  for (std::size_t i = 0; i < placed.size(); ++i) {
    EXPECT_TRUE(placed[i].box.within(space.frame));
    for (std::size_t k = i + 1; k < placed.size(); ++k) EXPECT_FALSE(placed[i].box.overlaps(placed[k].box));
    for (const PixelPoint& p : points)
      EXPECT_FALSE(placed[i].box.overlaps({p.x - 4, p.y - 4, p.x + 4, p.y + 4}));
  }
}

TEST(AccuracyPictures, onePerStudyWithRowsAndAnOverview) {
  const AccuracyRows rows = {modelRow("A", 0.1, 10), modelRow("B", 0.05, 20), rateRow(1000, 0.1, 3),
                             rateRow(2000, 0.05, 6)};
  const auto pictures = accuracyPictures(rows);
  ASSERT_EQ(pictures.size(), 3u);
  EXPECT_EQ(pictures[0].name, "accuracy_model");
  EXPECT_EQ(pictures[1].name, "accuracy_rate");
  EXPECT_EQ(pictures[2].name, "accuracy");
  EXPECT_TRUE(accuracyPictures({}).empty());
}

}  // namespace
}  // namespace needlelab
