// Near incompressibility: ten-node tetrahedra keep the closed form of a thick cylinder at ν = 0.49 and
// beyond; the four-node ones inside them (the same mesh, its middle nodes tied to the corners) do not.
#include <gtest/gtest.h>

#include <Eigen/SparseCholesky>
#include <cmath>
#include <numbers>

#include "common/fem/elasticity.h"

namespace needlelab::test {
namespace {

constexpr double kInner_m = 0.01, kOuter_m = 0.02, kThick_m = 0.002, kWiden_m = 1e-4;
constexpr double kShear_Pa = 3000;
constexpr int kAcross = 4, kAround = 8;

struct Energies {
  double exact = 0, ten_nodes = 0, four_nodes = 0;
};

// energy of a quarter cylinder in plane strain whose inner radius is widened, free outside
double exactEnergy(double poisson) {
  const double b_over = kWiden_m / ((1 - 2 * poisson) * kInner_m / (kOuter_m * kOuter_m) + 1 / kInner_m);
  const double pressure = 2 * kShear_Pa * b_over * (1 / (kInner_m * kInner_m) - 1 / (kOuter_m * kOuter_m));
  return 0.5 * pressure * kWiden_m * (std::numbers::pi / 2 * kInner_m) * kThick_m;
}

// least energy of the displacements  u = T q + u0, q free
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

  // ten nodes: every unknown that is not held; four nodes: middles are the mean of their corners
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
