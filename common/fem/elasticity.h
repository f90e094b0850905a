/// Small-strain isotropic elasticity on ten-node tetrahedra.
/// Quadratic displacements do not lock near incompressibility as four-node ones do (tests/unit/common/fem
/// shows both): a ten-node element has about 4 unknowns for each volume constraint, a four-node one about
/// half.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <vector>

#include "common/fem/tet_mesh.h"

namespace needlelab {

struct ElasticMaterial {
  double young_Pa = 0;
  double poisson = 0;  ///< [0, 0.5)
};

/// Of one element, unknowns in the order node 0 x y z, node 1 x y z, … In N/m.
Eigen::Matrix<double, 30, 30> elementStiffness(const TetMesh& mesh, const TetNodes& element,
                                               const ElasticMaterial& material);

/// The mesh's stiffness with unknown 3·node + axis, `index[unknown]` its row in the result; negative: held at
/// zero, left out. Lower triangle only.
Eigen::SparseMatrix<double> stiffnessMatrix(const TetMesh& mesh,
                                            const std::vector<ElasticMaterial>& materials,
                                            const std::vector<std::int32_t>& index, std::int32_t size);

/// Strain (symmetric gradient) in the middle of an element, `displacement_m` by unknown 3·node + axis.
Eigen::Matrix3d strainInMiddle(const TetMesh& mesh, const TetNodes& element,
                               const Eigen::VectorXd& displacement_m);

}  // namespace needlelab
