/// How far a mesh is from its limit.
#pragma once

#include "client/sim/accuracy/row.h"
#include "common/base/result.h"
#include "common/fem/needle_study.h"

namespace needlelab {

/// The paper's six layers as FEM, its tip as stiff as the scene's walls (femLikeForLike): all meshes have
/// this E. Errors: as there.
Result<FemScene> femScene();

/// From the errors of two meshes against a finest one: q and the finest one's own error, for errors that fall
/// as n^−q. Rising sizes, both below the finest. Not converging (errors that do not fall so): q is 0, the
/// rest is the second mesh's error.
struct FinestError {
  double order = 0, rest = 0;
};
FinestError finestError(double size_a, double error_a, double size_b, double error_b, double finest);

/// A row for each mesh but the last, which is the comparator; in groups of equal stations with rising nodes,
/// the finest group last. `young_factor`: as in FemScene.
AccuracyRows rowsOf(const std::vector<MeshRow>& meshes, double young_factor);

}  // namespace needlelab
