#include "common/fem/elasticity.h"

#include <Eigen/LU>
#include <cmath>

namespace needlelab {
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

}  // namespace needlelab
