// Rates and intervals of meshes whose errors follow a formula.
#include "client/sim/accuracy/study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace needlelab {
namespace {

TEST(Refinement, findsTheOrderAndWhatTheFinestMisses) {
  // true errors 100/n: compared with the mesh of 1600 they are smaller by 1/16
  const auto against = [](double n) { return 100 / n - 100 / 1600.0; };
  const FinestError found = finestError(100, against(100), 400, against(400), 1600);
  EXPECT_NEAR(found.order, 1, 1e-9);
  EXPECT_NEAR(found.rest, 100 / 1600.0, 1e-9);
}

TEST(Refinement, aNonDecreasingErrorHasNoOrderAndRemainsWhole) {
  const FinestError found = finestError(100, 0.2, 400, 0.3, 1600);
  EXPECT_EQ(found.order, 0);
  EXPECT_EQ(found.rest, 0.3);
}

std::vector<MeshRow> madeUpMeshes() {
  std::vector<MeshRow> meshes;
  for (const int stations : {15, 60})
    for (const int nodes : {100, 400, 1600}) {
      MeshRow mesh;
      mesh.nodes = nodes;
      mesh.stations = stations;
      mesh.first_cut_m = 0.005;
      mesh.stroke_m = 0.057;
      mesh.force_rms_error_N = 100.0 / nodes - 100.0 / 1600 + (stations == 15 ? 0.3 : 0);
      meshes.push_back(mesh);
    }
  return meshes;
}

TEST(MeshRows, haveTheFinestsOwnErrorAsTheirInterval) {
  const AccuracyRows rows = rowsOf(madeUpMeshes(), 27);
  ASSERT_EQ(rows.size(), 5u) << "all but the finest, which is the comparator";
  for (const AccuracyRow& row : rows) {
    EXPECT_NEAR(row.error_N->high - row.error_N->mean, 100.0 / 1600, 1e-9);
    EXPECT_THAT(row.against,
                testing::HasSubstr("1600 nodes, 60 stations; its own error falls as nodes^-1.00"));
    EXPECT_THAT(row.cannot_show, testing::HasSubstr("gives E, times 27 in all layers"));
  }
  EXPECT_EQ(rows[0].stations, 15.0);
  EXPECT_EQ(rows[4].nodes, 400.0);
}

TEST(MeshRows, nameAStrokeThatHangsOnWhetherItCuts) {
  auto meshes = madeUpMeshes();
  meshes[0].first_cut_m = 0.056;
  const AccuracyRows rows = rowsOf(meshes, 1);
  EXPECT_THAT(rows[0].cannot_show, testing::HasSubstr("the tip first cuts at 56 mm of a stroke of 57 mm"));
  EXPECT_THAT(rows[1].cannot_show, testing::Not(testing::HasSubstr("first cuts")));
}

// an earlier mistake: the needle indented 57 mm, the whole stroke, before it cut
TEST(FemScene, meetsTheStiffnessOfTheScenesWallsAndCutsEarly) {
  const auto scene = femScene();
  ASSERT_TRUE(scene.ok()) << scene.error().message;
  EXPECT_NEAR(scene->young_factor, 28, 3);
  const auto meshes = meshStudy(scene->spec, {{2000}});
  ASSERT_TRUE(meshes.ok());
  const MeshRow& mesh = meshes->front();
  ASSERT_TRUE(mesh.first_cut_m);
  // the first layer's cutting force at the walls' stiffness; the coarse mesh is stiffer
  const double indent_m = scene->spec.fem.layers[0].cutting_N / scene->spec.tracking_wall.stiffness_N_per_m;
  EXPECT_GT(*mesh.first_cut_m, 0.5 * indent_m);
  EXPECT_LT(*mesh.first_cut_m, 1.02 * indent_m);
  EXPECT_LT(mesh.work_J, -0.1);
  EXPECT_EQ(cutRemark(mesh), "");
}

}  // namespace
}  // namespace needlelab
