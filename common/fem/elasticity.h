/// Small-strain isotropic elasticity on ten-node tetrahedra: builds meshes from structured grids of cells,
/// assembles their stiffness, and solves. The elements have straight sides: the middle nodes lie in the
/// middle of the edges. Quadratic displacements do not lock near incompressibility as four-node ones do
/// (tests/unit/common/fem shows both): a ten-node element has about 4 unknowns for each volume constraint, a
/// four-node one about half.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <unordered_map>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// Corners 0-3 with positive volume, then the middles of the edges 01 12 02 03 13 23.
using TetNodes = std::array<std::int32_t, 10>;

/// The corners at the ends of each edge, in the order of the middle nodes.
inline constexpr std::array<std::array<int, 2>, 6> kTetEdges = {
    {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};

struct TetMesh {
  std::vector<Eigen::Vector3d> node_m;
  std::vector<TetNodes> element;
  std::vector<std::int32_t> material;  ///< per element: an index into the caller's list
};

/// A grid of cells, each cut into six tetrahedra along the diagonal from its least to its greatest corner
/// (Freudenthal), so that neighbours share whole faces. Corners at the same place may share one node:
/// tetrahedra without volume are omitted.
class GridMesh {
 public:
  /// Cells in each direction.
  struct Size {
    int i = 1, j = 1, k = 1;
  };
  using Place = std::function<Eigen::Vector3d(int i, int j, int k)>;
  using Material = std::function<int(int i, int j, int k)>;  ///< material of the cell whose least corner is
                                                             ///< (i, j, k)

  /// With `axis`, all corners with i = 0 and the same k are one node: the grid goes around that line.
  GridMesh(Size cells, const Place& place, const Material& material, bool axis = false);

  [[nodiscard]] const TetMesh& mesh() const { return mesh_; }
  [[nodiscard]] Size cells() const { return cells_; }
  /// The node at a corner of the grid.
  [[nodiscard]] std::int32_t corner(int i, int j, int k) const;
  /// The node in the middle of an edge of the mesh; the edge must exist.
  [[nodiscard]] std::int32_t middle(std::int32_t a, std::int32_t b) const;

 private:
  void addCell(int i, int j, int k, int material);
  std::int32_t middleOrNew(std::int32_t a, std::int32_t b);

  Size cells_;
  TetMesh mesh_;
  std::vector<std::int32_t> corner_;  ///< node of each corner
  std::unordered_map<std::uint64_t, std::int32_t> middle_;
};

/// Volume in m³; positive.
double volumeOf(const TetMesh& mesh, const TetNodes& element);

struct ElasticMaterial {
  double young_Pa = 0;
  double poisson = 0;  ///< [0, 0.5)
};

/// Stiffness of one element in N/m; unknowns in the order node 0 x y z, node 1 x y z, …
Eigen::Matrix<double, 30, 30> elementStiffness(const TetMesh& mesh, const TetNodes& element,
                                               const ElasticMaterial& material);

/// The mesh's stiffness with unknown 3·node + axis, `index[unknown]` is its row in the result; negative: the
/// unknown is held at zero and omitted. Lower triangle only.
Eigen::SparseMatrix<double> stiffnessMatrix(const TetMesh& mesh,
                                            const std::vector<ElasticMaterial>& materials,
                                            const std::vector<std::int32_t>& index, std::int32_t size);

/// Strain (symmetric gradient) in the middle of an element, `displacement_m` by unknown 3·node + axis.
Eigen::Matrix3d strainInMiddle(const TetMesh& mesh, const TetNodes& element,
                               const Eigen::VectorXd& displacement_m);

/// The mesh with its held nodes, factorised once (CHOLMOD, supernodal, over OpenBLAS), solved for many loads.
/// Unknowns are 3·node + axis throughout. Not copyable. Thread: one at a time.
class ElasticSolver {
 public:
  /// `held[unknown]`: displacement is prescribed. `mesh` must outlive it. Errors: kFailed when the
  /// factorisation fails (too few held unknowns to prevent rigid motion, or no memory).
  static Result<std::unique_ptr<ElasticSolver>> make(const TetMesh& mesh,
                                                     const std::vector<ElasticMaterial>& materials,
                                                     const std::vector<bool>& held);
  ~ElasticSolver();

  /// Displacements under loads (one column each, in N by unknown), held unknowns at zero. Errors: kFailed
  /// when memory runs out.
  [[nodiscard]] Result<Eigen::MatrixXd> solve(const Eigen::SparseMatrix<double>& loads_N) const;
  /// Displacements with the held unknowns at their values in `prescribed_m`, no load. Errors as `solve`.
  [[nodiscard]] Result<Eigen::VectorXd> solvePrescribed(const Eigen::VectorXd& prescribed_m) const;

  [[nodiscard]] double assembleSeconds() const { return assemble_s_; }
  [[nodiscard]] double factorSeconds() const { return factor_s_; }

 private:
  ElasticSolver();
  [[nodiscard]] Error failure(const char* step) const;
  [[nodiscard]] Result<Eigen::MatrixXd> solved(const Eigen::MatrixXd& rows) const;
  struct Factor;
  std::unique_ptr<Factor> factor_;
  const TetMesh* mesh_ = nullptr;
  std::vector<ElasticMaterial> materials_;
  std::vector<std::int32_t> index_;  ///< row of each unknown, −1 where held
  std::int32_t size_ = 0;
  double assemble_s_ = 0, factor_s_ = 0;
};

}  // namespace needlelab
