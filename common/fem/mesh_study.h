/// What the fineness of the mesh costs and gives.
#pragma once

#include <functional>
#include <vector>

#include "common/fem/needle_mesh.h"

namespace needlelab {

/// One rung of the ladder of meshes; the last rung is the reference of the others.
struct MeshRow {
  int nodes = 0, elements = 0, stations = 0;
  double assemble_s = 0, factor_s = 0, solve_s = 0;  ///< solve: all stations at once
  double precompute_s = 0;                           ///< all of it, mesh to compliance
  double one_solve_s = 0;  ///< one right-hand side: what a live step would cost without the compliance
  double live_step_p50_s = 0, live_step_p99_s = 0, live_step_max_s = 0;  ///< over `strokeOf`
  double stiffness_N_per_m = 0;  ///< of the needle stuck in the tissue over its whole length
  double stiffness_error = 0;    ///< relative to the finest mesh; positive is stiffer
  double tip_give_m_per_N = 0;   ///< of the tip half way down
  double tip_give_error = 0;     ///< relative to the finest mesh; negative is stiffer
  double force_rms_error_N = 0, force_max_error_N = 0;  ///< over `strokeOf`, to the finest mesh
  double strained_share = 0, strained_near_share = 0;   ///< see NeedleCompliance
};

/// The same scene on meshes of about `ladder` nodes, coarse to fine. `done` (may be empty) is told each rung
/// before its errors are known. Errors: as of `precomputeCompliance`; kInvalidInput when the ladder is empty.
Result<std::vector<MeshRow>> meshStudy(const SceneSpec& spec, const std::vector<int>& ladder,
                                       int stations = kDefaultStations,
                                       const std::function<void(const MeshRow&)>& done = {});

}  // namespace needlelab
