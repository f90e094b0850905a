// The models at equal stiffness, and what their ticks cost.
#include "client/sim/accuracy/study.h"

#include <gtest/gtest.h>

#include <atomic>
#include <set>
#include <thread>

#include "tests/support/run_form.h"

namespace needlelab {
namespace {

void quiet(std::string_view, double) {}

TEST(StudyModels, haveTheStiffnessOfTheScenesWalls) {
  const auto scene = studyScene();
  ASSERT_TRUE(scene.ok());
  const auto models = studyModels(*scene, 500);
  ASSERT_TRUE(models.ok()) << models.error().message;
  EXPECT_EQ(models->size(), kAxialModelCount + 1 + std::size(kStationCounts) - 1);
  std::set<int> stations;
  for (const StudyModel& study : *models) {
    if (study.stations > 0) {
      stations.insert(study.stations);
      continue;  // as stiff as the walls at the skin: refinement_test
    }
    const auto model = compile(study.spec, kStationRate_hz);
    ASSERT_TRUE(model.ok()) << model.error().message;
    EXPECT_DOUBLE_EQ(model->axial_stiffness_N_per_m, 500) << axialModelName(study.model);
  }
  EXPECT_EQ(stations, std::set<int>(std::begin(kStationCounts), std::end(kStationCounts)));
}

// false if the printed intervals of two ticks, p50 to p99.9, leave their order open
bool surelyLess(const LoopTimes& a, const LoopTimes& b) {
  return a.p999_ns < b.p50_ns;
}

// Idle and beside two busy threads: no pair of models changes its order beyond the printed intervals. The
// margins are formulas and stay the same.
TEST(MeasureCosts, costOrderIsStableIdleAndUnderLoad) {
  if (!test::longForm()) GTEST_SKIP() << "compares times: NEEDLELAB_LONG=1";
  const auto idle = measureCosts(0.3, quiet);
  std::atomic<bool> done{false};
  std::thread busy([&] {
    while (!done.load()) {
    }
  });
  const auto loaded = measureCosts(0.3, quiet);
  done = true;
  busy.join();
  if (!idle.ok() || !loaded.ok()) GTEST_FAIL() << (idle.ok() ? loaded : idle).error().message;
  ASSERT_EQ(idle->size(), loaded->size());
  for (std::size_t a = 0; a < idle->size(); ++a) {
    const LoopTimes& time = *(*idle)[a].time;
    EXPECT_GT(time.p50_ns, 0);
    EXPECT_LE(time.low_ns, time.p50_ns);
    EXPECT_LE(time.p50_ns, time.high_ns);
    EXPECT_LE(time.p50_ns, time.p999_ns);
    EXPECT_EQ((*idle)[a].margin, (*loaded)[a].margin);
    for (std::size_t b = 0; b < idle->size(); ++b)
      EXPECT_FALSE(surelyLess(*(*idle)[a].time, *(*idle)[b].time) &&
                   surelyLess(*(*loaded)[b].time, *(*loaded)[a].time))
          << (*idle)[a].model << " and " << (*idle)[b].model;
  }
  // b/(T (1/2 + delay))/K: 1.7 N·s/m, one tick of delay, 500 N/m
  EXPECT_NEAR(idle->front().margin, 1.7 * 1000 / 1.5 / 500, 1e-9);
}

// 10–20, 18–30 and 19–40 meet each other; 29–50 meets two of them, not the first
TEST(PrintAsEqual, givesOneTimeToRangesThatAllOverlap) {
  std::vector<ModelCost> costs = {{"D", "", 0, LoopTimes{45, 29, 50, 99}, {}, 0},
                                  {"B", "", 0, LoopTimes{25, 18, 30, 60}, {}, 0},
                                  {"untimed", "", 0, {}, {}, 0},
                                  {"A", "", 0, LoopTimes{15, 10, 20, 50}, {}, 0},
                                  {"C", "", 0, LoopTimes{35, 19, 40, 70}, {}, 0}};
  printAsEqual(costs);
  for (const std::size_t i : {1u, 3u, 4u}) {
    EXPECT_EQ(costs[i].time->p50_ns, 25) << costs[i].model;
    EXPECT_EQ(costs[i].time->low_ns, 10) << costs[i].model;
    EXPECT_EQ(costs[i].time->high_ns, 40) << costs[i].model;
  }
  EXPECT_EQ(costs[0].time->p50_ns, 45);
  EXPECT_EQ(costs[0].time->low_ns, 29);
  EXPECT_EQ(costs[3].time->p999_ns, 50) << "its own";
  EXPECT_FALSE(costs[2].time);
}

TEST(AddCosts, givesEachRowItsModelsTickAtTheStationsRateOnly) {
  const std::vector<ModelCost> costs = {{"VOIGT", "", 0, LoopTimes{1, 1, 2, 3}, 100.0, 2},
                                        {"FEM", "15 stations", 15, LoopTimes{4, 4, 5, 6}, 200.0, 1},
                                        {"FEM", "60 stations", 60, LoopTimes{7, 7, 8, 9}, 300.0, 1}};
  AccuracyRows rows(3);
  for (AccuracyRow& row : rows) row.model = "VOIGT";
  rows[1].rate_hz = 4000;
  rows[2].model = "FEM";
  rows[2].stations = 60;
  addCosts(costs, rows);
  EXPECT_EQ(rows[0].time->p999_ns, 3);
  EXPECT_FALSE(rows[1].time) << "another rate";
  EXPECT_EQ(rows[2].instructions, 300.0);
}

}  // namespace
}  // namespace needlelab
