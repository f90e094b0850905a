/// How far a mesh is from its limit.
#pragma once

#include "client/sim/accuracy/row.h"
#include "common/base/result.h"
#include "common/fem/needle_study.h"

namespace needlelab {

/// The paper's six layers as FEM with a tip as stiff as the scene's walls (femLikeForLike): all meshes have
/// this E. Errors: those of femLikeForLike.
Result<FemScene> femScene();

/// Convergence from the errors of two meshes relative to the finest: the order q and the finest mesh's own
/// error, assuming errors proportional to n^−q. Sizes ascend and are below the finest. If the errors do not
/// converge like that, q is 0 and the rest is the second mesh's error.
struct FinestError {
  double order = 0, rest = 0;
};
FinestError finestError(double size_a, double error_a, double size_b, double error_b, double finest);

/// One row per mesh except the last, which is the reference. Meshes are grouped by equal stations with
/// ascending nodes, the finest group last. `young_factor`: as in FemScene.
AccuracyRows rowsOf(const std::vector<MeshRow>& meshes, double young_factor);

}  // namespace needlelab
