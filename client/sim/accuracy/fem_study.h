/// The studies that rest on the reference FEM (common/fem): a reference for compliance, never for cutting.
#pragma once

#include "client/sim/accuracy/study.h"

namespace needlelab {

/// Study `model`: every model over strokes of a few millimetres, where tissue mostly gives way, against FEM
/// with a mesh that is four times as fine as the live one.
Result<AccuracyRows> modelFemStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                                   std::vector<std::string>& notes);

/// Study `model`: PRECOMPUTED with a table from FEM against FEM itself.
Result<AccuracyRows> tableRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                               std::vector<std::string>& notes);

/// Study `mesh`: sizes of the FEM mesh against the finest.
Result<AccuracyRows> meshRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                              std::vector<std::string>& notes);

}  // namespace needlelab
