/// The mesh with its held nodes, factorised once (CHOLMOD, supernodal, over OpenBLAS), solved for many loads.
#pragma once

#include <memory>

#include "common/base/result.h"
#include "common/fem/elasticity.h"

namespace needlelab {

/// Unknowns are 3·node + axis throughout. Not copyable. Thread: one at a time.
class ElasticSolver {
 public:
  /// `held[unknown]`: displacement is prescribed. `mesh` must outlive it. Errors: kFailed when the
  /// factorisation does (not enough held for a rigid body, or no memory).
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
