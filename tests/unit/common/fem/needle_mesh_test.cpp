// Checks the needle's compliance from the mesh against the theory of piles, and against the properties of
// every compliance.
#include <fmt/core.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <numbers>

#include "common/fem/needle_box.h"
#include "common/haptics/models/fem_needle.h"
#include "tests/unit/common/fem/soft_tissue.h"

namespace needlelab::test {
namespace {

using Matrix = Eigen::Map<const Eigen::MatrixXd>;
Matrix matrixOf(const NeedleCompliance& compliance) {
  const auto n = static_cast<Eigen::Index>(compliance.stations());
  return {compliance.give_m_per_N.data(), n, n};
}

// force per displacement of a needle stuck over its whole length: by Eigen, not by the live needle's solver
double stiffnessOf(const NeedleCompliance& compliance) {
  const Eigen::MatrixXd give = matrixOf(compliance);
  return give.ldlt().solve(Eigen::VectorXd::Ones(give.rows())).sum();
}

// a published case: G 3.45 kPa, ν 0.45, 20 mm, r₀ 0.4 mm
constexpr double kBlockShear_Pa = 3450, kBlockPoisson = 0.45, kLength_m = 0.02;
SceneSpec factsScene() {
  return softBlock(2 * kBlockShear_Pa * (1 + kBlockPoisson), kBlockPoisson, kLength_m);
}
double randolphWroth() {
  return 2 * std::numbers::pi * kBlockShear_Pa * kLength_m /
         std::log(2.5 * kLength_m * (1 - kBlockPoisson) / kNeedleRadius_m);
}

TEST(NeedleMesh, shaftIsAsStiffAsRandolphAndWrothSay) {
  EXPECT_NEAR(randolphWroth(), 102, 0.6);
  const auto compliance = complianceOf(factsScene(), 10'000, 20);
  const double stiffness = stiffnessOf(*compliance);
  EXPECT_NEAR(stiffness / randolphWroth(), 1.0, 0.10);
  // The mesh has tissue below the tip, too: with the base, 4 G r₀/(1 − ν), theory and mesh agree.
  const double base = 4 * kBlockShear_Pa * kNeedleRadius_m / (1 - kBlockPoisson);
  EXPECT_NEAR(stiffness / (randolphWroth() + base), 1.0, 0.05);
}

// Mindlin 1936: vertical displacement at radius r and depth z, for 1 N at depth c in a half-space
double mindlin(double r, double z, double c) {
  const double nu = kBlockPoisson, below = z - c, above = z + c;
  const double r1 = std::hypot(r, below), r2 = std::hypot(r, above);
  return ((3 - 4 * nu) / r1 + (8 * (1 - nu) * (1 - nu) - (3 - 4 * nu)) / r2 + below * below / (r1 * r1 * r1) +
          ((3 - 4 * nu) * above * above - 2 * c * z) / (r2 * r2 * r2) +
          6 * c * z * above * above / std::pow(r2, 5)) /
         (16 * std::numbers::pi * kBlockShear_Pa * (1 - nu));
}

// A load along the path that is 0 at both ends, spread around r₀, in a half-space: its displacement is an
// integral of Mindlin's. Returns the mesh's error, as rms of its mean displacements by station.
double offFromMindlin(int nodes) {
  constexpr int kStations = 20, kPieces = 4000, kAngles = 24;
  const auto load = [](double depth_m) {
    const double s = std::sin(std::numbers::pi * depth_m / kLength_m);
    return 10 * s * s;
  };
  const auto compliance = complianceOf(factsScene(), nodes, kStations);
  // the part that README.md adds to each station's compliance
  const double own_give = matrixOf(*compliance).diagonal().mean() * 0.01 / 1.01;
  double off = 0, all = 0;
  for (int i = 0; i < kStations; ++i) {
    const double spacing = kLength_m / kStations, z = (i + 0.5) * spacing;
    double expected = 0, found = 0;
    for (int j = 0; j < kStations; ++j) {
      double force = 0;
      for (int n = 0; n < 40; ++n) force += load((j + (n + 0.5) / 40) * spacing) * spacing / 40;
      const double own = i == j ? own_give : 0;
      found += (compliance->give(static_cast<std::size_t>(i), static_cast<std::size_t>(j)) - own) * force;
    }
    for (int a = 0; a < kAngles; ++a) {
      const double apart = 2 * kNeedleRadius_m * std::sin(std::numbers::pi * (a + 0.5) / (2 * kAngles));
      for (int n = 0; n < kPieces; ++n) {
        const double c = (n + 0.5) * kLength_m / kPieces;
        expected += mindlin(apart, z, c) * load(c) * kLength_m / kPieces / kAngles;
      }
    }
    off += (found - expected) * (found - expected);
    all += expected * expected;
  }
  return std::sqrt(off / all);
}

TEST(NeedleMesh, aLineLoadMovesTheHalfSpaceAsInMindlinsSolution) {
  const double coarse = offFromMindlin(2000), fine = offFromMindlin(16'000);
  EXPECT_LT(fine, 0.02) << coarse;
  EXPECT_LT(fine, 0.5 * coarse);
  RecordProperty("off", fmt::format("{:.4f}, {:.4f}", coarse, fine));
}

TEST(NeedleMesh, complianceChangesLittleBetweenTheTwoFinestMeshes) {
  const SceneSpec scene = factsScene();
  const int fine = longForm() ? 30'000 : 12'000, coarser = longForm() ? 10'000 : 5000;
  FemNeedle needle[2];
  double stiffness[2];
  for (const int n : {0, 1}) {
    SceneSpec with_mesh = scene;
    with_mesh.fem.compliance = complianceOf(scene, n == 0 ? coarser : fine, 20);
    needle[n] = compileNeedle(with_mesh);
    stiffness[n] = stiffnessOf(*with_mesh.fem.compliance);
    EXPECT_NEAR(needle[n].stiffness_N_per_m / stiffness[n], 1.0, 1e-9);  // the live needle's own solver
  }
  EXPECT_NEAR(stiffness[0] / stiffness[1], 1.0, 0.05);
  for (const double depth : {0.004, 0.01, 0.016})
    EXPECT_NEAR(tipGive_m_per_N(needle[0], depth) / tipGive_m_per_N(needle[1], depth), 1.0,
                longForm() ? 0.05 : 0.08)
        << "tip at " << depth;
}

TEST(NeedleMesh, complianceIsSymmetricAndPositiveDefinite) {
  // including more stations than the mesh can resolve
  for (const int stations : {1, 10, 60}) {
    const auto compliance = complianceOf(factsScene(), 1000, stations);
    const Eigen::MatrixXd give = matrixOf(*compliance);
    EXPECT_EQ(give, give.transpose());
    const Eigen::VectorXd values =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(give, Eigen::EigenvaluesOnly).eigenvalues();
    EXPECT_GT(values.minCoeff(), 1e-4 * give.diagonal().mean()) << stations << " stations";
    EXPECT_GT(give.minCoeff(), 0.0);  // all tissue moves with the needle
  }
}

TEST(NeedleMesh, complianceScalesWithTheInverseOfYoung) {
  const auto soft = complianceOf(softBlock(5e3, 0.45, 0.03), 1000, 10);
  const auto hard = complianceOf(softBlock(50e3, 0.45, 0.03), 1000, 10);
  EXPECT_LT((10 * matrixOf(*hard) - matrixOf(*soft)).cwiseAbs().maxCoeff(),
            1e-9 * matrixOf(*soft).maxCoeff());
}

TEST(NeedleMesh, complianceOfTwoLayersLiesBetweenTheirs) {
  SceneSpec scene = softBlock(5e3, 0.45, 0.03);
  scene.layers[0].thickness_m = 0.015;
  scene.layers.push_back(scene.layers[0]);
  scene.fem.layers.push_back({20e3, 0.45, 0, 0});
  const auto layered = complianceOf(scene, 3000, 12);
  const auto soft = complianceOf(softBlock(5e3, 0.45, 0.03), 3000, 12);
  const auto hard = complianceOf(softBlock(20e3, 0.45, 0.03), 3000, 12);
  EXPECT_LT(stiffnessOf(*layered), stiffnessOf(*hard));
  EXPECT_GT(stiffnessOf(*layered), stiffnessOf(*soft));
  // Deep in a layer it is almost that layer's own value.
  EXPECT_NEAR(layered->give(2, 2) / soft->give(2, 2), 1.0, 0.12);
  EXPECT_NEAR(layered->give(10, 10) / hard->give(10, 10), 1.0, 0.12);
}

TEST(NeedleMesh, farBoundaryHardlyMatters) {
  const SceneSpec scene = factsScene();
  NeedleMeshOptions options;
  options.nodes = 10'000;
  options.stations = 10;
  const auto near = precomputeCompliance(scene, options);
  options.half_width_per_length = 32;
  const auto far = precomputeCompliance(scene, options);
  EXPECT_NEAR(stiffnessOf(**near) / stiffnessOf(**far), 1.0, 0.02);
}

TEST(NeedleMesh, loadIsSpreadOverTheWholeSurfaceOfAStation) {
  NeedleBoxSpec spec;
  spec.length_m = 0.02;
  spec.radius_m = kNeedleRadius_m;
  spec.half_width_m = 0.1;
  spec.depth_m = 0.1;
  spec.top_m = {0, 0.0031};
  spec.materials = {{5e3, 0.45}, {9e3, 0.45}};
  const NeedleBox box(spec, 2000);
  const std::vector<double> edges = {0, 0.0013, 0.0050, 0.0200};
  const auto loads = box.surfaceLoads(edges);
  for (int c = 0; c < 3; ++c) {
    double sum = 0, moment = 0;
    for (Eigen::SparseMatrix<double>::InnerIterator at(loads, c); at; ++at) {
      const Eigen::Vector3d& p = box.mesh().node_m[static_cast<std::size_t>(at.row() / 3)];
      EXPECT_EQ(at.row() % 3, 2);
      // on the circle with the polygon's circumference
      EXPECT_NEAR(p.head<2>().norm(), kNeedleRadius_m, 0.06 * kNeedleRadius_m);
      sum += at.value();
      moment += at.value() * p.z();
    }
    const auto edge = static_cast<std::size_t>(c);
    EXPECT_NEAR(sum, 1.0, 1e-12);
    EXPECT_NEAR(moment, 0.5 * (edges[edge] + edges[edge + 1]), 1e-12);
  }
}

TEST(NeedleMesh, everyLayerHasCells) {
  SceneSpec scene = softBlock(5e3, 0.45, 0.06);
  scene.layers.assign(8, scene.layers[0]);
  scene.fem.layers.assign(8, scene.fem.layers[0]);
  for (std::size_t i = 0; i < 8; ++i) {
    scene.layers[i].thickness_m = 0.0005 * static_cast<double>(i + 1);
    scene.fem.layers[i].young_Pa = 1e3 * static_cast<double>(i + 1);
  }
  const auto fine = complianceOf(scene, 500, 20);
  EXPECT_GT(fine->nodes, 500);  // eight layers need more
  EXPECT_GT(stiffnessOf(*fine), 0.0);
}

TEST(NeedleMesh, strainedShareGrowsWithTheForce) {
  SceneSpec scene = softBlock(10e3, 0.45, 0.04, 0, 1e-4);
  EXPECT_EQ(complianceOf(scene, 1000, 20)->strained_share, 0.0);
  scene.fem.layers[0].cutting_N = 0.5;
  const double some = complianceOf(scene, 1000, 20)->strained_share;
  scene.fem.layers[0].cutting_N = 2.0;
  const double more = complianceOf(scene, 1000, 20)->strained_share;
  EXPECT_GT(some, 0.0);
  EXPECT_GT(more, some);
}

TEST(NeedleMesh, refusesUnmeshableInputByName) {
  const auto wordsFor = [](const SceneSpec& scene, NeedleMeshOptions options = {}) {
    const auto compliance = precomputeCompliance(scene, options);
    EXPECT_FALSE(compliance.ok());
    return compliance.ok() ? std::string() : compliance.error().message;
  };
  SceneSpec scene = softBlock(5e3, 0.45, 0.03);
  scene.fem.layers[0].poisson = 0.5;
  EXPECT_EQ(wordsFor(scene), "fem.layers[0].poisson: 0.5 is out of range [0, 0.49]");
  scene.fem.layers[0].poisson = 0.45;
  scene.fem.layers.push_back(scene.fem.layers[0]);
  EXPECT_NE(wordsFor(scene).find("fem.layers: 2 given, the scene has 1 layers"), std::string::npos);
  scene.fem.layers.pop_back();
  NeedleMeshOptions options;
  options.nodes = 50;
  EXPECT_EQ(wordsFor(scene, options).find("fem.nodes: 50 is out of range [100, "), 0u);
  options.nodes = 1000;
  options.stations = 129;
  EXPECT_EQ(wordsFor(scene, options), "stations: 129 is out of range [1, 128]");
}

}  // namespace
}  // namespace needlelab::test
