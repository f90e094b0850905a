// Offline FEM as a table, and its loss of accuracy.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "common/fem/needle_study.h"
#include "common/haptics/models/like_for_like.h"
#include "tests/support/scenes/scenes.h"
#include "tests/unit/common/fem/soft_tissue.h"

namespace needlelab::test {
namespace {

SceneSpec twoLayers() {
  SceneSpec scene = softBlock(60e3, 0.45, 0.04, 15, 0.6);
  scene.layers[0].thickness_m = 0.015;
  scene.layers.push_back(scene.layers[0]);
  scene.layers[1].thickness_m = 0.05;
  scene.fem.layers.push_back({120e3, 0.45, 20, 1.1});
  scene.fem.compliance = complianceOf(scene, 1000, 40);
  return scene;
}

TEST(ForceTable, isTheLiveNeedlesForceOnTheWayInAndOut) {
  const SceneSpec scene = twoLayers();
  const auto table = forceTable(scene, 0.035, 301);
  ASSERT_TRUE(table.ok()) << table.error().message;
  ASSERT_EQ(table->size(), 301u);
  EXPECT_EQ(table->front().depth_m, 0.0);
  EXPECT_EQ(table->front().cutting_N, 0.0);
  EXPECT_NEAR(table->back().depth_m, 0.035, 1e-15);

  // the same stroke, ten times finer
  std::vector<double> depths;
  for (int k = 1; k <= 17'500; ++k) depths.push_back(2e-6 * k);
  for (int k = 17'499; k >= 1; --k) depths.push_back(2e-6 * k);
  const std::vector<double> forces = forcesOn(compileNeedle(scene), depths);
  for (std::size_t r = 1; r < table->size(); ++r) {
    const auto at = static_cast<std::size_t>(std::lround((*table)[r].depth_m / 2e-6)) - 1;
    const double off_m = std::fabs(depths[at] - (*table)[r].depth_m);
    const double near = 0.006 + 500 * off_m;
    EXPECT_NEAR((*table)[r].cutting_N, std::max(0.0, -forces[at]), near) << (*table)[r].depth_m;
    EXPECT_NEAR((*table)[r].attracted_N, std::max(0.0, forces[forces.size() - 1 - at]), near)
        << (*table)[r].depth_m;
  }
}

TEST(ForceTable, wallRendersItNearLiveFem) {
  const SceneSpec fem = twoLayers();
  SceneSpec table = fem;
  table.axial_model = AxialModel::kPrecomputed;
  table.effects |= bitOf(Effect::kAttracted);
  table.precomputed.table = *forceTable(fem, studyDepth(fem));
  const auto error = tableError(fem, table);
  ASSERT_TRUE(error.ok()) << error.error().message;
  EXPECT_GT(error->fem_peak_N, 1.0);
  // On the way in, the wall follows the table where the table is not steeper than the wall's spring.
  EXPECT_LT(error->in_rms_N, 0.03 * error->fem_peak_N);
  // A stop relaxes the wall but not FEM; a reversal follows the wall's spring, not the mesh's.
  EXPECT_GT(error->max_N, error->in_rms_N);
  EXPECT_EQ(error->depth_m.size(), error->fem_N.size());
  EXPECT_EQ(error->depth_m.size(), error->table_N.size());

  // an empty table is far off: the measure can fail
  SceneSpec empty = table;
  for (auto& row : empty.precomputed.table) row.cutting_N = row.attracted_N = 0;
  empty.precomputed.table.back().cutting_N = 1e-3;
  EXPECT_GT(tableError(fem, empty)->rms_N, 5 * error->in_rms_N);
}

TEST(ForceTable, needsAMeshAndRows) {
  SceneSpec scene = twoLayers();
  EXPECT_FALSE(forceTable(scene, 0.03, 1).ok());
  EXPECT_FALSE(forceTable(scene, 0.03, 1025).ok());
  scene.fem.compliance = nullptr;
  EXPECT_FALSE(forceTable(scene, 0.03).ok());
}

TEST(NeedleStudy, errorsAreToTheFinestMeshAndFall) {
  const SceneSpec scene = twoLayers();
  int told = 0;
  const auto rows = meshStudy(scene, {{500, 30}, {1500, 30}, {4000, 30}}, [&](const MeshRow&) { ++told; });
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  ASSERT_EQ(rows->size(), 3u);
  EXPECT_EQ(told, 3);
  EXPECT_EQ(rows->back().stiffness_error, 0.0);
  EXPECT_EQ(rows->back().force_max_error_N, 0.0);
  EXPECT_GT((*rows)[0].stiffness_error, (*rows)[1].stiffness_error);
  EXPECT_GT((*rows)[0].force_rms_error_N, 0.0);
  for (const MeshRow& row : *rows) {
    EXPECT_GT(row.live_step_p50_s, 0.0);
    EXPECT_GT(row.precompute_s, row.factor_s);
  }
  EXPECT_FALSE(meshStudy(scene, {}).ok());
}

// the load is spread over a length, so more stations refine it: the paper's layers, as stiff as its walls
TEST(NeedleStudy, moreStationsConvergeAtTheSameStiffness) {
  const auto fem = femLikeForLike(paperSixLayers());
  ASSERT_TRUE(fem.ok()) << fem.error().message;
  const auto rows = meshStudy(fem->spec, {{4000, 15}, {4000, 30}, {4000, 60}, {4000, 90}, {4000, 128}});
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  for (const MeshRow& row : *rows)
    RecordProperty(fmt::format("stations_{}", row.stations),
                   fmt::format("{:.4f} N at 1 mm, rms {:.4f} N from the finest, max {:.4f} N", row.at_1mm_N,
                               row.force_rms_error_N, row.force_max_error_N));
  EXPECT_LT((*rows)[3].force_rms_error_N, 0.02);
  for (std::size_t r = 0; r + 2 < rows->size(); ++r)
    EXPECT_GT((*rows)[r].force_rms_error_N, (*rows)[r + 1].force_rms_error_N) << r;
}

// Q(n) = Q∞ + A n^−q
std::vector<double> changesOf(const std::vector<int>& nodes, double factor, double order) {
  std::vector<double> changes;
  for (std::size_t k = 0; k + 1 < nodes.size(); ++k)
    changes.push_back(factor * (std::pow(nodes[k + 1], -order) - std::pow(nodes[k], -order)));
  return changes;
}

TEST(MeshLimits, followTheFormulaForAllMeshRatios) {
  const std::vector<int> nodes = {1000, 1500, 4000, 9000, 30'000};
  for (const double order : {0.3, 1.0, 1.7})
    for (const double factor : {-400.0, 250.0}) {
      const auto limits = limitsOf(nodes, changesOf(nodes, factor, order));
      ASSERT_EQ(limits.size(), nodes.size());
      EXPECT_FALSE(limits[0] || limits[1]);
      for (std::size_t m = 2; m < nodes.size(); ++m) {
        ASSERT_TRUE(limits[m] && limits[m]->converges) << order;
        const double rest = -factor * std::pow(nodes[m], -order);
        EXPECT_NEAR(limits[m]->order, order, 1e-6);
        EXPECT_NEAR(limits[m]->rest, rest, 1e-6 * std::fabs(rest));
        ASSERT_EQ(limits[m]->error.has_value(), m > 2);
        EXPECT_LE(limits[m]->error.value_or(0), 1e-6 * std::fabs(rest));
      }
    }
}

TEST(MeshLimits, theErrorIsTheChangeFromThePreviousPrediction) {
  // halves, then thirds: the first three predict a remainder of 1, of which 2/3 came; the last three predict
  // 1/3
  const auto limits = limitsOf({1000, 2000, 4000, 8000}, {2, 1, 1.0 / 3});
  ASSERT_TRUE(limits[2] && limits[3]);
  EXPECT_NEAR(limits[2]->rest, 1, 1e-9);
  EXPECT_FALSE(limits[2]->error);
  EXPECT_NEAR(limits[3]->order, std::log2(3), 1e-9);
  EXPECT_NEAR(limits[3]->rest, 1.0 / 6, 1e-9);
  EXPECT_NEAR(*limits[3]->error, 1 - 1.0 / 3 - 1.0 / 6, 1e-9);
}

TEST(MeshLimits, changesThatDoNotFallHaveNoLimit) {
  const auto converges = [](const std::vector<int>& nodes, const std::vector<double>& changes) {
    const auto limits = limitsOf(nodes, changes);
    return limits.back()->converges;
  };
  EXPECT_FALSE(converges({1000, 2000, 4000}, {1, 1}));
  EXPECT_FALSE(converges({1000, 2000, 4000}, {1, 3})) << "they rise";
  EXPECT_FALSE(converges({1000, 2000, 4000}, {1, -0.2})) << "to and fro";
  EXPECT_FALSE(converges({1000, 2000, 2000}, {1, 0.1})) << "the same mesh twice";
  EXPECT_TRUE(converges({1000, 2000, 4000}, {1, 0}));
  // a step of 10 in nodes, then one of 2: the last change is smaller, but not by any power of the nodes
  EXPECT_FALSE(converges({1000, 10'000, 20'000}, {1, 0.4}));
  EXPECT_TRUE(converges({1000, 10'000, 20'000}, {1, 0.2}));
}

TEST(NeedleStudy, aFinerMeshApproachesThePredictedLimit) {
  const auto rows = meshStudy(twoLayers(), {{1000, 30}, {2000, 30}, {4000, 30}, {8000, 30}});
  ASSERT_TRUE(rows.ok()) << rows.error().message;
  for (std::size_t m = 0; m < 2; ++m) EXPECT_FALSE((*rows)[m].force_limit_N);
  const MeshRow& last = rows->back();
  ASSERT_TRUE(last.work_limit_J && last.force_limit_N && last.stiffness_limit_N_per_m);
  const MeshLimit limit = *last.stiffness_limit_N_per_m;
  ASSERT_TRUE(limit.converges);
  EXPECT_LT(limit.rest, 0) << "finer is softer";

  NeedleMeshOptions options;
  options.nodes = 16'000;
  options.stations = 30;
  SceneSpec fine = twoLayers();
  fine.fem.compliance = *precomputeCompliance(fine, options);
  // the remaining error on the finer mesh
  const double left =
      limit.rest * std::pow(static_cast<double>(fine.fem.compliance->nodes) / last.nodes, -limit.order);
  const double change = compileNeedle(fine).stiffness_N_per_m - last.stiffness_N_per_m;
  EXPECT_NEAR(change, limit.rest - left, 0.5 * std::fabs(change));
}

// one layer without friction, in which the tip at the skin first cuts after `share` of the stroke
SceneSpec cutsAt(double share) {
  constexpr double kMeshCutting_N = 0.6;
  SceneSpec scene = softBlock(10e3, 0.45, 0.04, 0, kMeshCutting_N);
  scene.fem.nodes = 1000;
  const auto factor = scaleToTipStiffness(scene, kMeshCutting_N / (share * studyDepth(scene)));
  EXPECT_TRUE(factor.ok());
  return scene;
}
MeshRow onOneMesh(const SceneSpec& scene) {
  return meshStudy(scene, {{scene.fem.nodes}})->front();
}

TEST(ScaleToTipStiffness, theTipMeetsItAtTheSkinAndLayerRatiosStay) {
  SceneSpec scene = twoLayers();
  scene.fem.nodes = 1000;
  const auto factor = scaleToTipStiffness(scene, 500);
  ASSERT_TRUE(factor.ok()) << factor.error().message;
  EXPECT_NEAR(scene.fem.layers[0].young_Pa, *factor * 60e3, 1e-6);
  EXPECT_NEAR(scene.fem.layers[1].young_Pa, 2 * scene.fem.layers[0].young_Pa, 1e-6);
  EXPECT_EQ(scene.fem.compliance, nullptr) << "it was that of the softer tissue";
  scene.fem.compliance = complianceOf(scene, 1000, kDefaultStations);
  EXPECT_NEAR(tipGive_m_per_N(compileNeedle(scene), 0), 1.0 / 500, 1e-9);
  EXPECT_FALSE(scaleToTipStiffness(scene, 0).ok());
}

TEST(NeedleStudy, theFirstCutIsWhereTheTissueHasGivenWay) {
  const MeshRow row = onOneMesh(cutsAt(0.25));
  ASSERT_TRUE(row.first_cut_m);
  EXPECT_NEAR(*row.first_cut_m, 0.25 * row.stroke_m, 0.01 * row.stroke_m);
  EXPECT_EQ(row.cut_share, 1);
  EXPECT_EQ(cutRemark(row), "");
}

// a scene can be so soft that 2 % of compliance decide whether a mesh cuts at all
TEST(NeedleStudy, aStrokeOnTheVergeOfCuttingIsMarked) {
  const MeshRow late = onOneMesh(cutsAt(0.98)), never = onOneMesh(cutsAt(1.02));
  ASSERT_TRUE(late.first_cut_m);
  EXPECT_NE(cutRemark(late).find("the tip first cuts at 37.2 mm of a stroke of 38 mm"), std::string::npos)
      << cutRemark(late);
  EXPECT_FALSE(never.first_cut_m);
  EXPECT_NEAR(never.cut_share, 1 / 1.02, 0.001);
  EXPECT_NE(cutRemark(never).find("the tip never cuts in this stroke (it reaches 98 %"), std::string::npos)
      << cutRemark(never);
}

TEST(NeedleStudy, theWorkOfAStrokeIsThatOfTheCut) {
  const SceneSpec scene = cutsAt(0.05);
  const MeshRow row = onOneMesh(scene);
  SceneSpec with_mesh = scene;
  with_mesh.fem.compliance = complianceOf(scene, scene.fem.nodes, kDefaultStations);
  const double cut_m = row.stroke_m - 0.6 * tipGive_m_per_N(compileNeedle(with_mesh), row.stroke_m);
  EXPECT_NEAR(row.work_J, -0.6 * cut_m, 0.02 * 0.6 * cut_m);
  // without a cut the tissue gives all work back
  EXPECT_NEAR(onOneMesh(cutsAt(1.1)).work_J, 0, 1e-3 * 0.6 * row.stroke_m);
}

TEST(NeedleStudy, oneSolveIsTimedManyTimes) {
  const MeshRow row = onOneMesh(cutsAt(0.25));
  EXPECT_TRUE(row.one_solve.solves == 1000 || row.one_solve.all_s >= 0.5) << row.one_solve.solves;
  // in three of the five runs, half of the solves took at least p50
  EXPECT_GE(row.one_solve.all_s, 0.3 * row.one_solve.p50_s * static_cast<double>(row.one_solve.solves));
  EXPECT_GT(row.one_solve.p50_s, 0);
  EXPECT_GE(row.one_solve.p99_s, row.one_solve.p50_s);
}

}  // namespace
}  // namespace needlelab::test
