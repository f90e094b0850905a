// Rows of made-up meshes, and the scene of the real ones.
#include "client/sim/accuracy/study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace needlelab {
namespace {

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
      mesh.force_max_error_N = 7 * mesh.force_rms_error_N;
      mesh.force_max_depth_m = nodes == 100 ? 0.055 : 0.031;
      mesh.force_max_out = nodes == 400;
      mesh.precompute_s = 1e-3 * nodes;
      meshes.push_back(mesh);
    }
  return meshes;
}

TEST(MeshRows, haveTheirErrorAgainstTheFinestAndItsPrice) {
  const AccuracyRows rows = rowsOf(madeUpMeshes(), 27);
  ASSERT_EQ(rows.size(), 5u) << "all but the finest, which is the comparator";
  for (const AccuracyRow& row : rows) {
    EXPECT_TRUE(std::isinf(row.error_N->high)) << "one value has no interval";
    EXPECT_EQ(*row.greatest_N, 7 * row.error_N->mean);
    EXPECT_EQ(*row.prepare_s, 1e-3 * *row.nodes);
    EXPECT_THAT(row.against, testing::HasSubstr("1600 nodes, 60 stations"));
    EXPECT_THAT(row.cannot_show, testing::HasSubstr("gives E, times 27 in all layers"));
  }
  EXPECT_EQ(rows[0].greatest_at, "at the turn") << "55 of 57 mm";
  EXPECT_EQ(rows[1].greatest_at, "31 mm, out");
  EXPECT_EQ(rows[2].greatest_at, "31 mm, in");
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
