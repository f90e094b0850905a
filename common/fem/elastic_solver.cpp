#include "common/fem/elastic_solver.h"

#include <Eigen/CholmodSupport>
#include <string>

#include "common/fem/stopwatch.h"

namespace needlelab {

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
  // nested dissection alone: on such meshes it always wins, and trying others costs time
  llt.cholmod().nmethods = 1;
  llt.cholmod().method[0].ordering = CHOLMOD_METIS;
  llt.cholmod().print = 0;
  // CHOLMOD's own status is asked at each step: Eigen's goes on with a factor that is not there
  llt.analyzePattern(matrix);
  if (llt.cholmod().status < CHOLMOD_OK) return solver->failure("ordered");
  llt.factorize(matrix);
  solver->factor_s_ = watch.lap();
  if (llt.cholmod().status < CHOLMOD_OK || llt.info() != Eigen::Success) return solver->failure("factorised");
  return solver;
}

Error ElasticSolver::failure(const char* step) const {
  const std::string what =
      "the stiffness of the mesh (" + std::to_string(mesh_->node_m.size()) + " nodes) could not be " + step;
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
  // the held unknowns' part goes to the right-hand side, element by element
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
