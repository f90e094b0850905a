#include "common/fem/elasticity.h"

#include <fmt/core.h>

#include <Eigen/CholmodSupport>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <string>

#include "common/base/time/clock.h"

namespace needlelab {
namespace {

/// The orders of steps along i, j, k on a path from a cell's least corner to its greatest.
constexpr std::array<std::array<int, 3>, 6> kPaths = {
    {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}}};

std::uint64_t edgeKey(std::int32_t a, std::int32_t b) {
  const auto [low, high] = std::minmax(a, b);
  return static_cast<std::uint64_t>(low) << 32 | static_cast<std::uint32_t>(high);
}

}  // namespace

double volumeOf(const TetMesh& mesh, const TetNodes& e) {
  const auto at = [&](std::size_t n) -> const Eigen::Vector3d& {
    return mesh.node_m[static_cast<std::size_t>(e[n])];
  };
  return (at(1) - at(0)).cross(at(2) - at(0)).dot(at(3) - at(0)) / 6.0;
}

GridMesh::GridMesh(Size cells, const Place& place, const Material& material, bool axis) : cells_(cells) {
  corner_.reserve(static_cast<std::size_t>(cells.i + 1) * static_cast<std::size_t>(cells.j + 1) *
                  static_cast<std::size_t>(cells.k + 1));
  for (int k = 0; k <= cells.k; ++k)
    for (int j = 0; j <= cells.j; ++j)
      for (int i = 0; i <= cells.i; ++i) {
        if (axis && i == 0 && j > 0) {
          corner_.push_back(corner(0, 0, k));
          continue;
        }
        corner_.push_back(static_cast<std::int32_t>(mesh_.node_m.size()));
        mesh_.node_m.push_back(place(i, j, k));
      }
  for (int k = 0; k < cells.k; ++k)
    for (int j = 0; j < cells.j; ++j)
      for (int i = 0; i < cells.i; ++i) addCell(i, j, k, material(i, j, k));
}

std::int32_t GridMesh::corner(int i, int j, int k) const {
  return corner_[static_cast<std::size_t>((k * (cells_.j + 1) + j) * (cells_.i + 1) + i)];
}

std::int32_t GridMesh::middle(std::int32_t a, std::int32_t b) const {
  return middle_.at(edgeKey(a, b));
}

std::int32_t GridMesh::middleOrNew(std::int32_t a, std::int32_t b) {
  const auto [at, is_new] =
      middle_.try_emplace(edgeKey(a, b), static_cast<std::int32_t>(mesh_.node_m.size()));
  if (is_new)
    mesh_.node_m.push_back(
        0.5 * (mesh_.node_m[static_cast<std::size_t>(a)] + mesh_.node_m[static_cast<std::size_t>(b)]));
  return at->second;
}

void GridMesh::addCell(int i, int j, int k, int material) {
  for (const auto& path : kPaths) {
    TetNodes e{};
    std::array<int, 3> at = {i, j, k};
    e[0] = corner(i, j, k);
    for (std::size_t step = 0; step < 3; ++step) {
      ++at[static_cast<std::size_t>(path[step])];
      e[step + 1] = corner(at[0], at[1], at[2]);
    }
    // a path along j on the axis stays where it is
    if (e[0] == e[1] || e[1] == e[2] || e[2] == e[3]) continue;
    if (volumeOf(mesh_, e) < 0) std::swap(e[1], e[2]);
    for (std::size_t n = 0; n < kTetEdges.size(); ++n)
      e[4 + n] = middleOrNew(e[static_cast<std::size_t>(kTetEdges[n][0])],
                             e[static_cast<std::size_t>(kTetEdges[n][1])]);
    mesh_.element.push_back(e);
    mesh_.material.push_back(material);
  }
}

namespace {

using Gradients = Eigen::Matrix<double, 3, 10>;  // ∂N/∂x of each node

// gradients of the four barycentric coordinates, constant in a straight-sided element
Eigen::Matrix<double, 3, 4> barycentricGradients(const TetMesh& mesh, const TetNodes& e) {
  Eigen::Matrix3d edges;
  const Eigen::Vector3d& origin = mesh.node_m[static_cast<std::size_t>(e[0])];
  for (int c = 0; c < 3; ++c)
    edges.col(c) = mesh.node_m[static_cast<std::size_t>(e[static_cast<std::size_t>(c) + 1])] - origin;
  Eigen::Matrix<double, 3, 4> g;
  g.rightCols<3>() = edges.inverse().transpose();
  g.col(0) = -g.rightCols<3>().rowwise().sum();
  return g;
}

// N_a = λ_a (2 λ_a − 1), N_ab = 4 λ_a λ_b
Gradients shapeGradients(const Eigen::Matrix<double, 3, 4>& g, const Eigen::Vector4d& at) {
  Gradients d;
  for (int a = 0; a < 4; ++a) d.col(a) = (4.0 * at[a] - 1.0) * g.col(a);
  for (int n = 0; n < 6; ++n) {
    const auto [a, b] = kTetEdges[static_cast<std::size_t>(n)];
    d.col(4 + n) = 4.0 * (at[a] * g.col(b) + at[b] * g.col(a));
  }
  return d;
}

}  // namespace

Eigen::Matrix<double, 30, 30> elementStiffness(const TetMesh& mesh, const TetNodes& element,
                                               const ElasticMaterial& material) {
  const double lambda =
      material.young_Pa * material.poisson / ((1.0 + material.poisson) * (1.0 - 2.0 * material.poisson));
  const double mu = 0.5 * material.young_Pa / (1.0 + material.poisson);
  const auto g = barycentricGradients(mesh, element);
  // four points of degree 2: exact, as the integrand is a product of two linear functions
  const double far = (5.0 + 3.0 * std::sqrt(5.0)) / 20.0, near = (5.0 - std::sqrt(5.0)) / 20.0;
  const double weight = 0.25 * volumeOf(mesh, element);
  Eigen::Matrix<double, 30, 30> stiffness = Eigen::Matrix<double, 30, 30>::Zero();
  for (int q = 0; q < 4; ++q) {
    Eigen::Vector4d at = Eigen::Vector4d::Constant(near);
    at[q] = far;
    const Gradients d = shapeGradients(g, at);
    const Eigen::Matrix<double, 10, 10> dots = d.transpose() * d;
    // K_ab = λ d_a d_bᵀ + μ d_b d_aᵀ + μ (d_a·d_b) I
    for (int b = 0; b < 10; ++b)
      for (int a = b; a < 10; ++a) {
        Eigen::Matrix3d block =
            lambda * d.col(a) * d.col(b).transpose() + mu * d.col(b) * d.col(a).transpose();
        block.diagonal().array() += mu * dots(a, b);
        stiffness.block<3, 3>(3 * a, 3 * b) += weight * block;
      }
  }
  for (int b = 0; b < 10; ++b)
    for (int a = b + 1; a < 10; ++a)
      stiffness.block<3, 3>(3 * b, 3 * a) = stiffness.block<3, 3>(3 * a, 3 * b).transpose();
  return stiffness;
}

Eigen::SparseMatrix<double> stiffnessMatrix(const TetMesh& mesh,
                                            const std::vector<ElasticMaterial>& materials,
                                            const std::vector<std::int32_t>& index, std::int32_t size) {
  std::vector<Eigen::Triplet<double, int>> entries;
  entries.reserve(mesh.element.size() * 465);
  for (std::size_t n = 0; n < mesh.element.size(); ++n) {
    const TetNodes& e = mesh.element[n];
    const auto stiffness = elementStiffness(mesh, e, materials[static_cast<std::size_t>(mesh.material[n])]);
    std::array<int, 30> row{};
    for (std::size_t u = 0; u < 30; ++u) row[u] = index[static_cast<std::size_t>(e[u / 3]) * 3 + u % 3];
    for (std::size_t c = 0; c < 30; ++c) {
      if (row[c] < 0) continue;
      for (std::size_t r = 0; r < 30; ++r)
        if (row[r] >= row[c])
          entries.emplace_back(row[r], row[c], stiffness(static_cast<int>(r), static_cast<int>(c)));
    }
  }
  Eigen::SparseMatrix<double> matrix(size, size);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

Eigen::Matrix3d strainInMiddle(const TetMesh& mesh, const TetNodes& element,
                               const Eigen::VectorXd& displacement_m) {
  const Gradients d = shapeGradients(barycentricGradients(mesh, element), Eigen::Vector4d::Constant(0.25));
  Eigen::Matrix3d gradient = Eigen::Matrix3d::Zero();
  for (int a = 0; a < 10; ++a)
    gradient += displacement_m.segment<3>(3 * element[static_cast<std::size_t>(a)]) * d.col(a).transpose();
  return 0.5 * (gradient + gradient.transpose());
}

struct ElasticSolver::Factor {
  Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>, Eigen::Lower> llt;
};

ElasticSolver::ElasticSolver() : factor_(std::make_unique<Factor>()) {}
ElasticSolver::~ElasticSolver() = default;

Result<std::unique_ptr<ElasticSolver>> ElasticSolver::make(const TetMesh& mesh,
                                                           const std::vector<ElasticMaterial>& materials,
                                                           const std::vector<bool>& held) {
  std::unique_ptr<ElasticSolver> solver(new ElasticSolver);
  solver->mesh_ = &mesh;
  solver->materials_ = materials;
  for (const bool is_held : held) solver->index_.push_back(is_held ? -1 : solver->size_++);

  Stopwatch watch;
  const auto matrix = stiffnessMatrix(mesh, materials, solver->index_, solver->size_);
  solver->assemble_s_ = watch.lap();
  auto& llt = solver->factor_->llt;
  // nested dissection only: it always wins on such meshes, and trying others costs time
  llt.cholmod().nmethods = 1;
  llt.cholmod().method[0].ordering = CHOLMOD_METIS;
  llt.cholmod().print = 0;
  // check CHOLMOD's own status at each step, because Eigen continues without a factor
  llt.analyzePattern(matrix);
  if (llt.cholmod().status < CHOLMOD_OK) return solver->failure("ordered");
  llt.factorize(matrix);
  solver->factor_s_ = watch.lap();
  if (llt.cholmod().status < CHOLMOD_OK || llt.info() != Eigen::Success) return solver->failure("factorised");
  return solver;
}

Error ElasticSolver::failure(const char* step) const {
  const std::string what =
      fmt::format("the stiffness of the mesh ({} nodes) could not be {}", mesh_->node_m.size(), step);
  if (factor_->llt.cholmod().status == CHOLMOD_OUT_OF_MEMORY)
    return {ErrorCode::kFailed, what + ": memory ran out; try fewer nodes"};
  return {ErrorCode::kFailed, what +
                                  ": too few nodes are held, an element has no volume, or the mesh is too "
                                  "large; try fewer nodes"};
}

Result<Eigen::MatrixXd> ElasticSolver::solved(const Eigen::MatrixXd& rows) const {
  Eigen::MatrixXd free = factor_->llt.solve(rows);
  if (factor_->llt.cholmod().status < CHOLMOD_OK || factor_->llt.info() != Eigen::Success)
    return failure("solved");
  return free;
}

Result<Eigen::MatrixXd> ElasticSolver::solve(const Eigen::SparseMatrix<double>& loads_N) const {
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(size_, loads_N.cols());
  for (int c = 0; c < loads_N.outerSize(); ++c)
    for (Eigen::SparseMatrix<double>::InnerIterator at(loads_N, c); at; ++at)
      if (const auto row = index_[static_cast<std::size_t>(at.row())]; row >= 0) rows(row, c) += at.value();
  const auto free = solved(rows);
  if (!free.ok()) return free.error();
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(index_.size()), loads_N.cols());
  for (std::size_t u = 0; u < index_.size(); ++u)
    if (index_[u] >= 0) all.row(static_cast<Eigen::Index>(u)) = free->row(index_[u]);
  return all;
}

Result<Eigen::VectorXd> ElasticSolver::solvePrescribed(const Eigen::VectorXd& prescribed_m) const {
  // move the held unknowns' part to the right-hand side, element by element
  Eigen::VectorXd rows = Eigen::VectorXd::Zero(size_);
  for (std::size_t n = 0; n < mesh_->element.size(); ++n) {
    const TetNodes& e = mesh_->element[n];
    const auto stiffness =
        elementStiffness(*mesh_, e, materials_[static_cast<std::size_t>(mesh_->material[n])]);
    for (int c = 0; c < 30; ++c) {
      const auto unknown_c =
          static_cast<std::size_t>(e[static_cast<std::size_t>(c) / 3]) * 3 + static_cast<std::size_t>(c) % 3;
      if (index_[unknown_c] >= 0) continue;
      for (int r = 0; r < 30; ++r) {
        const auto unknown_r = static_cast<std::size_t>(e[static_cast<std::size_t>(r) / 3]) * 3 +
                               static_cast<std::size_t>(r) % 3;
        if (index_[unknown_r] >= 0)
          rows[index_[unknown_r]] -= stiffness(r, c) * prescribed_m[static_cast<Eigen::Index>(unknown_c)];
      }
    }
  }
  const auto free = solved(rows);
  if (!free.ok()) return free.error();
  Eigen::VectorXd all = prescribed_m;
  for (std::size_t u = 0; u < index_.size(); ++u)
    if (index_[u] >= 0) all[static_cast<Eigen::Index>(u)] = (*free)(index_[u], 0);
  return all;
}

}  // namespace needlelab
