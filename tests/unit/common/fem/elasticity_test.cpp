// Checks the elements themselves against closed forms that every correct finite element satisfies.
#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>
#include <Eigen/SparseCholesky>
#include <cmath>
#include <numbers>

#include "common/fem/elasticity.h"
#include "tests/support/random.h"

namespace needlelab::test {
namespace {

constexpr double kYoung_Pa = 12e3;

// a block of irregular cells: inner corners are moved at random, the outside stays a box
GridMesh crookedBlock(std::uint64_t seed) {
  Random random(seed);
  static constexpr int n = 3;
  return GridMesh(
      {n, n, n},
      [&](int i, int j, int k) {
        Eigen::Vector3d p(0.02 * i / n, 0.03 * j / n, 0.01 * k / n);
        const auto inside = [](int at) { return at > 0 && at < n; };
        if (inside(i) && inside(j) && inside(k))
          p += Eigen::Vector3d(random.in(-1, 1), random.in(-1, 1), random.in(-1, 1)) * 5e-4;
        return p;
      },
      [](int, int, int) { return 0; });
}

bool onBox(const Eigen::Vector3d& p) {
  constexpr double kNear = 1e-9;
  return p.x() < kNear || p.y() < kNear || p.z() < kNear || p.x() > 0.02 - kNear || p.y() > 0.03 - kNear ||
         p.z() > 0.01 - kNear;
}

std::vector<std::int32_t> allFree(const TetMesh& mesh) {
  std::vector<std::int32_t> index(3 * mesh.node_m.size());
  for (std::size_t u = 0; u < index.size(); ++u) index[u] = static_cast<std::int32_t>(u);
  return index;
}

TEST(Elasticity, gridOfCellsFillsItsVolume) {
  const GridMesh grid = crookedBlock(3);
  double volume = 0;
  for (const TetNodes& e : grid.mesh().element) {
    EXPECT_GT(volumeOf(grid.mesh(), e), 0.0);
    volume += volumeOf(grid.mesh(), e);
  }
  EXPECT_NEAR(volume, 0.02 * 0.03 * 0.01, 1e-15);
  EXPECT_EQ(grid.mesh().element.size(), 6u * 27u);
  // ten-node tetrahedra on such a grid have their nodes on a grid twice as fine
  EXPECT_EQ(grid.mesh().node_m.size(), 7u * 7u * 7u);
}

TEST(Elasticity, patchTest) {
  for (const double poisson : {0.0, 0.3, 0.49}) {
    const GridMesh grid = crookedBlock(7);
    const TetMesh& mesh = grid.mesh();
    Eigen::Matrix3d gradient;
    gradient << 1e-3, 4e-4, -2e-4, 3e-4, -2e-3, 5e-4, 7e-4, -6e-4, 1.5e-3;
    std::vector<bool> held;
    Eigen::VectorXd exact(static_cast<Eigen::Index>(3 * mesh.node_m.size()));
    for (std::size_t n = 0; n < mesh.node_m.size(); ++n) {
      exact.segment<3>(static_cast<Eigen::Index>(3 * n)) =
          gradient * mesh.node_m[n] + Eigen::Vector3d(1e-3, 2e-3, -1e-3);
      held.insert(held.end(), 3, onBox(mesh.node_m[n]));
    }
    const auto solver = ElasticSolver::make(mesh, {{kYoung_Pa, poisson}}, held);
    ASSERT_TRUE(solver.ok());
    Eigen::VectorXd prescribed = exact;
    for (std::size_t u = 0; u < held.size(); ++u)
      if (!held[u]) prescribed[static_cast<Eigen::Index>(u)] = 0;
    const Eigen::VectorXd found = *(*solver)->solvePrescribed(prescribed);
    EXPECT_LT((found - exact).cwiseAbs().maxCoeff(), 1e-14) << "Poisson " << poisson;
    for (const TetNodes& e : mesh.element)
      EXPECT_LT((strainInMiddle(mesh, e, found) - 0.5 * (gradient + gradient.transpose())).norm(), 1e-11);
  }
}

TEST(Elasticity, exactlySixRigidModesCostNothing) {
  const GridMesh grid(
      {1, 1, 1},
      [](int i, int j, int k) {
        return Eigen::Vector3d(0.011 * i + 0.002 * j, 0.009 * j + 0.001 * k, 0.013 * k);
      },
      [](int, int, int) { return 0; });
  const TetMesh& mesh = grid.mesh();
  const auto index = allFree(mesh);
  const Eigen::SparseMatrix<double> whole =
      stiffnessMatrix(mesh, {{kYoung_Pa, 0.45}}, index, static_cast<int>(index.size()))
          .selfadjointView<Eigen::Lower>();
  const Eigen::MatrixXd stiffness = whole;
  const Eigen::VectorXd values =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(stiffness, Eigen::EigenvaluesOnly).eigenvalues();
  const double greatest = values.maxCoeff();
  EXPECT_LT(std::fabs(values[5]), 1e-12 * greatest);
  EXPECT_GT(values[6], 1e-6 * greatest);

  // the modes themselves: translation, and rotation about any point
  for (int mode = 0; mode < 6; ++mode) {
    Eigen::VectorXd u(values.size());
    for (std::size_t n = 0; n < mesh.node_m.size(); ++n)
      u.segment<3>(static_cast<Eigen::Index>(3 * n)) =
          mode < 3 ? Eigen::Vector3d(Eigen::Vector3d::Unit(mode))
                   : Eigen::Vector3d(Eigen::Vector3d::Unit(mode - 3).cross(mesh.node_m[n]));
    EXPECT_LT(u.dot(stiffness * u), 1e-12 * greatest * u.squaredNorm()) << "mode " << mode;
  }
}

// a bar pulled at its ends, with free sides
TEST(Elasticity, pulledBarStretchesByYoungAndNarrowsByPoisson) {
  constexpr double kPoisson = 0.37, kWidth = 0.01, kLength = 0.04, kStretch = 1e-4;
  const GridMesh grid(
      {2, 2, 5},
      [&](int i, int j, int k) { return Eigen::Vector3d(kWidth * i / 2, kWidth * j / 2, kLength * k / 5); },
      [](int, int, int) { return 0; });
  const TetMesh& mesh = grid.mesh();
  std::vector<bool> held;
  Eigen::VectorXd prescribed = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(3 * mesh.node_m.size()));
  for (std::size_t n = 0; n < mesh.node_m.size(); ++n) {
    const Eigen::Vector3d& p = mesh.node_m[n];
    const bool top = p.z() > kLength - 1e-9;
    held.push_back(p.x() < 1e-9);  // planes of symmetry
    held.push_back(p.y() < 1e-9);
    held.push_back(p.z() < 1e-9 || top);
    if (top) prescribed[static_cast<Eigen::Index>(3 * n + 2)] = kStretch;
  }
  const std::vector<ElasticMaterial> material = {{kYoung_Pa, kPoisson}};
  const auto solver = ElasticSolver::make(mesh, material, held);
  ASSERT_TRUE(solver.ok());
  const Eigen::VectorXd u = *(*solver)->solvePrescribed(prescribed);
  for (std::size_t n = 0; n < mesh.node_m.size(); ++n) {
    const Eigen::Vector3d& p = mesh.node_m[n];
    EXPECT_NEAR(u[static_cast<Eigen::Index>(3 * n)], -kPoisson * kStretch / kLength * p.x(), 1e-15);
    EXPECT_NEAR(u[static_cast<Eigen::Index>(3 * n + 2)], kStretch / kLength * p.z(), 1e-15);
  }
  // the force is E A ε: from the energy ½ F Δ
  const auto index = allFree(mesh);
  const auto stiffness = stiffnessMatrix(mesh, material, index, static_cast<int>(index.size()));
  const double energy = 0.5 * u.dot(stiffness.selfadjointView<Eigen::Lower>() * u);
  const double force = kYoung_Pa * kWidth * kWidth * kStretch / kLength;
  EXPECT_NEAR(energy, 0.5 * force * kStretch, 1e-9 * force * kStretch);
}

}  // namespace

namespace {

// Near incompressibility: ten-node tetrahedra keep the closed form of a thick cylinder at ν = 0.49 and
// beyond; four-node ones (the same mesh, with the middle nodes tied to the corners) do not.

constexpr double kInner_m = 0.01, kOuter_m = 0.02, kThick_m = 0.002, kWiden_m = 1e-4;
constexpr double kShear_Pa = 3000;
constexpr int kAcross = 4, kAround = 8;

struct Energies {
  double exact = 0, ten_nodes = 0, four_nodes = 0;
};

// The energy of a quarter cylinder in plane strain with its inner surface moved outward, free outside.
double exactEnergy(double poisson) {
  const double b_over = kWiden_m / ((1 - 2 * poisson) * kInner_m / (kOuter_m * kOuter_m) + 1 / kInner_m);
  const double pressure = 2 * kShear_Pa * b_over * (1 / (kInner_m * kInner_m) - 1 / (kOuter_m * kOuter_m));
  return 0.5 * pressure * kWiden_m * (std::numbers::pi / 2 * kInner_m) * kThick_m;
}

// minimum energy over displacements  u = T q + u0, q free
double leastEnergy(const Eigen::SparseMatrix<double>& stiffness, const Eigen::SparseMatrix<double>& tie,
                   const Eigen::VectorXd& start) {
  const Eigen::SparseMatrix<double> reduced = tie.transpose() * stiffness * tie;
  const Eigen::VectorXd load = -(tie.transpose() * (stiffness * start));
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(reduced);
  const Eigen::VectorXd u = tie * solver.solve(load) + start;
  return 0.5 * u.dot(stiffness * u);
}

Energies energiesAt(double poisson) {
  const GridMesh grid(
      {kAcross, kAround, 1},
      [](int i, int j, int k) {
        const double r = kInner_m + (kOuter_m - kInner_m) * i / kAcross;
        const double angle = std::numbers::pi / 2 * j / kAround;
        return Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), kThick_m * k);
      },
      [](int, int, int) { return 0; });
  const TetMesh& mesh = grid.mesh();
  const auto size = static_cast<int>(3 * mesh.node_m.size());
  std::vector<std::int32_t> index(static_cast<std::size_t>(size));
  for (std::size_t u = 0; u < index.size(); ++u) index[u] = static_cast<std::int32_t>(u);
  const double young = 2 * kShear_Pa * (1 + poisson);
  const Eigen::SparseMatrix<double> stiffness =
      stiffnessMatrix(mesh, {{young, poisson}}, index, size).selfadjointView<Eigen::Lower>();

  // plane strain, the two planes of symmetry, and the inner surface moved outward
  std::vector<bool> held(index.size());
  Eigen::VectorXd start = Eigen::VectorXd::Zero(size);
  for (std::size_t n = 0; n < mesh.node_m.size(); ++n) {
    const Eigen::Vector3d& p = mesh.node_m[n];
    const double r = p.head<2>().norm();
    const bool inner = r < kInner_m + 1e-9;
    held[3 * n] = inner || p.x() < 1e-9;
    held[3 * n + 1] = inner || p.y() < 1e-9;
    held[3 * n + 2] = true;
    if (inner) start.segment<2>(static_cast<Eigen::Index>(3 * n)) = kWiden_m / r * p.head<2>();
  }

  // ten nodes: every unknown not held; four nodes: a middle is the mean of its corners
  std::vector<int> column(index.size(), -1);
  int columns = 0;
  std::vector<Eigen::Triplet<double>> ten;
  for (std::size_t u = 0; u < index.size(); ++u)
    if (!held[u]) ten.emplace_back(static_cast<int>(u), column[u] = columns++, 1.0);
  Eigen::SparseMatrix<double> ten_tie(size, columns);
  ten_tie.setFromTriplets(ten.begin(), ten.end());

  std::vector<std::array<std::int32_t, 2>> ends(mesh.node_m.size(), {-1, -1});
  constexpr int kEdges[6][2] = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};
  for (const TetNodes& e : mesh.element)
    for (std::size_t m = 0; m < 6; ++m)
      ends[static_cast<std::size_t>(e[4 + m])] = {e[static_cast<std::size_t>(kEdges[m][0])],
                                                  e[static_cast<std::size_t>(kEdges[m][1])]};
  Eigen::VectorXd four_start = start;
  std::vector<Eigen::Triplet<double>> four;
  std::fill(column.begin(), column.end(), -1);
  columns = 0;
  for (std::size_t n = 0; n < ends.size(); ++n)
    for (std::size_t axis = 0; ends[n][0] < 0 && axis < 3; ++axis)
      if (!held[3 * n + axis])
        four.emplace_back(static_cast<int>(3 * n + axis), column[3 * n + axis] = columns++, 1.0);
  for (std::size_t n = 0; n < ends.size(); ++n)
    for (std::size_t axis = 0; ends[n][0] >= 0 && axis < 3; ++axis) {
      const auto u = static_cast<Eigen::Index>(3 * n + axis);
      four_start[u] = 0;
      for (const std::int32_t end : ends[n]) {
        const auto from = static_cast<std::size_t>(3 * end) + axis;
        four_start[u] += 0.5 * start[static_cast<Eigen::Index>(from)];
        if (column[from] >= 0) four.emplace_back(static_cast<int>(u), column[from], 0.5);
      }
    }
  Eigen::SparseMatrix<double> four_tie(size, columns);
  four_tie.setFromTriplets(four.begin(), four.end());
  return {exactEnergy(poisson), leastEnergy(stiffness, ten_tie, start),
          leastEnergy(stiffness, four_tie, four_start)};
}

TEST(Locking, tenNodesKeepTheThickCylinderNearIncompressibility) {
  for (const double poisson : {0.3, 0.45, 0.49, 0.4999}) {
    const Energies energy = energiesAt(poisson);
    EXPECT_NEAR(energy.ten_nodes / energy.exact, 1.0, 0.02) << "Poisson " << poisson;
  }
}

TEST(Locking, fourNodesWouldLock) {
  const Energies mild = energiesAt(0.3), near = energiesAt(0.49), nearer = energiesAt(0.4999);
  EXPECT_NEAR(mild.four_nodes / mild.exact, 1.0, 0.1);
  EXPECT_GT(near.four_nodes / near.exact, 1.2);
  EXPECT_GT(nearer.four_nodes / nearer.exact, 10.0);
}

}  // namespace

}  // namespace needlelab::test
