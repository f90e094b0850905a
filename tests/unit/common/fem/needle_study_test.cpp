// Tests offline FEM as a table, and the loss of accuracy.
#include <gtest/gtest.h>

#include <cmath>

#include "common/fem/needle_study.h"
#include "common/haptics/models/like_for_like.h"
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

  // the same stroke, ten times as fine
  std::vector<double> depths;
  for (int k = 1; k <= 17'500; ++k) depths.push_back(2e-6 * k);
  for (int k = 17'499; k >= 1; --k) depths.push_back(2e-6 * k);
  const std::vector<double> forces = forcesOn(compileNeedle(scene), depths);
  for (std::size_t r = 1; r < table->size(); ++r) {
    const auto at = static_cast<std::size_t>(std::lround((*table)[r].depth_m / 2e-6)) - 1;
    const double off_m = std::fabs(depths[at] - (*table)[r].depth_m);
    const double near = 0.005 + 500 * off_m;
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

TEST(MeshStudy, errorsAreToTheFinestMeshAndFall) {
  const SceneSpec scene = twoLayers();
  int told = 0;
  const auto rows = meshStudy(scene, {500, 1500, 4000}, 30, [&](const MeshRow&) { ++told; });
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

}  // namespace
}  // namespace needlelab::test
