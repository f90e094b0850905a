/// The studies of the accuracy report. Each part is a function that gives rows; the list is in study.cpp.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/accuracy/row.h"
#include "common/base/result.h"
#include "common/fem/needle_study.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// Instructions of a tick, counted under callgrind (study_models.h).
struct CountedTick {
  std::string scene, choice;  ///< of the profile; of the model, with its variant
  double instructions = 0;
};

/// Options for every study.
struct AccuracyOptions {
  bool long_form = false;      ///< more seeds, more repeats, larger meshes: minutes instead of seconds
  std::filesystem::path data;  ///< folder of the recordings (../shared/data); empty = not there
  bool full = false;  ///< the long form, the loop of milliseconds, the finest meshes: no limit of time
  std::vector<CountedTick> counted = {};  ///< empty = not counted
  std::optional<CostEffort> effort = {};  ///< in place of the form's
};

/// How much of a tick's cost is measured with these options.
CostEffort costEffort(const AccuracyOptions& options);

/// A study calls it now and then with its current work and the share of its work that is done (0-1).
using AccuracyProgress = std::function<void(std::string_view doing, double share)>;

/// One part of the report. Parts of one study differ in reference or scene.
struct AccuracyPart {
  AccuracyStudy study;
  std::string_view name;  ///< of the part, e.g. "scene profile"
  /// Rows in display order. If the study's data are missing: no rows, and a remark by `note`. Thread: one.
  /// Deterministic except for measured times.
  Result<AccuracyRows> (*run)(const AccuracyOptions& options, const AccuracyProgress& progress,
                              std::vector<std::string>& notes);
};

/// All parts, in the order of the report.
const std::vector<AccuracyPart>& accuracyParts();

/// The force along the trajectory of every model (likeForLike) over the same seeded gestures, against
/// ForceProfile. A model that cannot be made is left out with a note.
Result<AccuracyRows> modelProfileStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                                       std::vector<std::string>& notes);

/// Study `model`: every model over strokes of a few millimetres, where tissue mostly gives way, against FEM
/// with a mesh that is four times as fine as the live one.
Result<AccuracyRows> modelFemStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                                   std::vector<std::string>& notes);

/// Study `model`: PRECOMPUTED with a table from FEM against FEM itself.
Result<AccuracyRows> tableRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                               std::vector<std::string>& notes);

/// What a table of FEM misses on the way out, as a remark, where a hand notices it; else empty. A table knows
/// depth and direction, not what the shaft remembers.
std::string withdrawalRemark(const TableError& error);

/// Its rows: every mesh with its compliance made before, then every mesh solved in each tick, against the
/// last of `meshes` in the paper's six layers. `young_factor`: as in FemScene. Not empty.
AccuracyRows rowsOf(const std::vector<MeshRow>& meshes, double young_factor);

/// The paper's six layers as FEM at like stiffness (femLikeForLike): as derived, they would be indented for
/// 57 mm before the needle cuts. Errors: as there.
Result<FemScene> femScene();

/// Study `mesh`: sizes of the FEM mesh against the finest.
Result<AccuracyRows> meshRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                              std::vector<std::string>& notes);

/// The same hand in closed loop at 250 Hz to 10 kHz; error of the force that acts on the hand against a loop
/// of 20 kHz.
Result<AccuracyRows> rateStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                               std::vector<std::string>& notes);

/// The steps of the standard resolution, all of them scaled as the length's step is to `length_m`; the tick's
/// own times keep 1 µs. 0 = lossless. Quaternions go to 2⁻¹² at most.
Resolution scaledResolution(double length_m);

/// Length steps of 0.1 µm to 100 µm and lossless: bytes and time a sample, error of the stored force and of
/// the force that the engine computes again from the stored poses.
Result<AccuracyRows> storageStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                                  std::vector<std::string>& notes);

/// Live frames of 5 to 200 ms through a real TLS connection on this machine.
Result<AccuracyRows> liveStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                               std::vector<std::string>& notes);

}  // namespace needlelab
