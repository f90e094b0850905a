/// Drives the live FEM needle offline, straight in and out along the normal: force tables, comparisons, and
/// cost and accuracy of finer meshes.
#pragma once

#include <functional>
#include <vector>

#include "common/base/result.h"
#include "common/fem/needle_mesh.h"
#include "common/haptics/models/fem_needle.h"

namespace needlelab {

/// Depths of the tip over time: in to `depth_m`, a hold, out again, minimum-jerk, at 1 kHz; `seconds` each
/// way. All above 0.
std::vector<double> strokeOf(double depth_m, double seconds = 2.0, double hold_s = 0.2);

/// Force along u at each depth of a stroke that begins outside (negative: against the insertion).
std::vector<double> forcesOn(const FemNeedle& needle, const std::vector<double>& depth_m);

/// The greatest depth of a table or study in a scene: the needle's length, or all layers but the last and a
/// share of the last, whichever is less.
double studyDepth(const SceneSpec& spec);

/// Quasi-static insertion to `depth_m` and withdrawal from there, as PRECOMPUTED's table of `rows` depths
/// from 0. On the way in, the force holds the needle back; on the way out, it pulls the needle in; a
/// withdrawal from a smaller depth is assumed to feel the same. The scene must have its compliance. Errors:
/// kInvalidInput when it has none, or for rows outside [2, 1024].
Result<std::vector<PrecomputedSpec::Row>> forceTable(const SceneSpec& spec, double depth_m, int rows = 501);

/// The difference between the table, rendered by the tracking wall, and live FEM, in the engine at `rate_hz`,
/// over the same straight stroke into the scene's limb.
struct TableError {
  double rms_N = 0, max_N = 0;
  double max_depth_m = 0;  ///< tip depth of the greatest difference
  double in_rms_N = 0, hold_rms_N = 0, out_rms_N = 0;
  double fem_peak_N = 0;                        ///< for scale
  std::vector<double> depth_m, fem_N, table_N;  ///< each tick in tissue, forces along u
};
/// `fem` must have its compliance; `table` is the same scene with PRECOMPUTED and its table. Errors: as
/// `compile`.
Result<TableError> tableError(const SceneSpec& fem, const SceneSpec& table, double rate_hz = 1000);

/// One mesh of the ladder; the last mesh is the reference for the others.
struct MeshRow {
  int nodes = 0, elements = 0, stations = 0;
  double assemble_s = 0, factor_s = 0, solve_s = 0;  ///< solve: all stations at once
  double precompute_s = 0;                           ///< all of it, mesh to compliance
  double one_solve_s = 0;  ///< one right-hand side: the cost of a live step without the compliance
  double live_step_p50_s = 0, live_step_p99_s = 0, live_step_max_s = 0;  ///< over `strokeOf`
  double stiffness_N_per_m = 0;  ///< of the needle stuck in the tissue over its whole length
  double stiffness_error = 0;    ///< relative to the finest mesh; positive is stiffer
  double tip_give_m_per_N = 0;   ///< of the tip half way down
  double tip_give_error = 0;     ///< relative to the finest mesh; negative is stiffer
  double force_rms_error_N = 0, force_max_error_N = 0;  ///< over `strokeOf`, to the finest mesh
  double strained_share = 0, strained_near_share = 0;   ///< see NeedleCompliance
};

/// The same scene on meshes of about `ladder` nodes, coarse to fine. Calls `done` (may be empty) with each
/// mesh before its errors are known. Errors: as `precomputeCompliance`; kInvalidInput when the ladder is
/// empty.
Result<std::vector<MeshRow>> meshStudy(const SceneSpec& spec, const std::vector<int>& ladder,
                                       int stations = kDefaultStations,
                                       const std::function<void(const MeshRow&)>& done = {});

}  // namespace needlelab
