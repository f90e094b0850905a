/// Drives the live FEM needle offline, straight in and out along the normal: force tables, comparisons, and
/// cost and accuracy of finer meshes.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/fem/needle_mesh.h"
#include "common/haptics/models/fem_needle.h"
#include "common/haptics/models/like_for_like.h"

namespace needlelab {

/// Tip depths over time at 1 kHz: in to `depth_m`, a hold, out again, with minimum jerk; `seconds` each way.
/// All parameters must be above 0.
std::vector<double> strokeOf(double depth_m, double seconds = 2.0, double hold_s = 0.2);

/// Force along u at each depth of a stroke that begins outside (negative: against the insertion).
std::vector<double> forcesOn(const FemNeedle& needle, const std::vector<double>& depth_m);

/// The greatest depth of a table or study in a scene: the needle's length, or all layers but the last plus a
/// share of the last if that is less.
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

/// Multiplies E of all layers by one factor, so that the tip at the skin meets `stiffness_N_per_m` on a mesh
/// of `spec.fem.nodes` with the default stations (the tissue is linear: one compliance gives the factor).
/// Returns the factor. Errors: as `precomputeCompliance`; kInvalidInput for a stiffness that is not above 0.
Result<double> scaleToTipStiffness(SceneSpec& spec, double stiffness_N_per_m);

/// A scene as FEM, to be compared with the same scene under other models.
struct FemScene {
  SceneSpec spec;           ///< without a compliance
  double young_factor = 1;  ///< factor applied to E of all layers, on top of `likeForLike`
};
/// `likeForLike` with FEM, at equal stiffness. A scene without a `fem` section gets its E from the lateral
/// stiffness, which may be so soft that the needle indents the tissue by its whole length before it cuts.
/// Therefore E is multiplied by one factor, so that at the skin the tip meets the stiffness of the scene's
/// walls, on a mesh of about `nodes` (also written to the section). A scene with the section keeps it. Takes
/// as long as computing one mesh. Errors: as `scaleToTipStiffness`; kInvalidInput for a body.
Result<FemScene> femLikeForLike(const SceneSpec& scene, int nodes = kDefaultFemNodes);

/// How a quantity would change from a mesh to ever finer ones: Richardson's estimate from that mesh and the
/// previous two, for changes that fall as a power of the number of nodes (or stations). The numbers need not
/// grow by equal factors.
struct MeshLimit {
  bool converges = false;  ///< false: the changes do not fall like that, and the rest is unknown
  double order = 0;        ///< q: the error falls as nodes^−q
  double rest = 0;         ///< from this mesh to the limit, with the changes' sign and unit
  /// How much the estimate from the three meshes ending one mesh earlier differs. Empty when there are no
  /// such meshes or they did not converge.
  std::optional<double> error = {};
};
/// Limits for each mesh of a ladder; empty for the first two. `changes[k]`: from mesh k to mesh k + 1, a
/// difference or a norm of it; one fewer than `nodes`. If the numbers of nodes do not rise, the result does
/// not converge.
std::vector<std::optional<MeshLimit>> limitsOf(const std::vector<int>& nodes,
                                               const std::vector<double>& changes);

/// One mesh of the ladder; the last mesh is the reference for the others.
struct MeshRow {
  int nodes = 0, elements = 0, stations = 0;
  double assemble_s = 0, factor_s = 0, solve_s = 0;                      ///< solve: all stations at once
  double precompute_s = 0;                                               ///< all of it, mesh to compliance
  SolveTimes one_solve;                                                  ///< without the compliance
  double live_step_p50_s = 0, live_step_p99_s = 0, live_step_max_s = 0;  ///< over `strokeOf`
  double at_1mm_N = 0;           ///< force on the needle 1 mm deep, on the way in
  double stiffness_N_per_m = 0;  ///< of the needle stuck in the tissue over its whole length
  double stiffness_error = 0;    ///< relative to the finest mesh; positive is stiffer
  double tip_give_m_per_N = 0;   ///< of the tip half way down
  double tip_give_error = 0;     ///< relative to the finest mesh; negative is stiffer
  double force_rms_error_N = 0, force_max_error_N = 0;  ///< over `strokeOf`, to the finest mesh
  double force_max_depth_m = 0;                         ///< the tip's depth at the greatest error
  bool force_max_out = false;                           ///< it is on the way out
  double strained_share = 0, strained_near_share = 0;   ///< see NeedleCompliance
  double stroke_m = 0;                                  ///< the greatest depth of `strokeOf`
  double work_J = 0;                  ///< work of the force on the needle over `strokeOf`; negative: done by
                                      ///< the hand
  std::optional<double> first_cut_m;  ///< the needle's depth at which the tip first cuts
  double cut_share = 0;  ///< the greatest share of the cutting force that the tip reached; 1 when it cuts
  /// For the force (rms over the stroke), the rest is this mesh's distance from the limit.
  std::optional<MeshLimit> force_limit_N, work_limit_J, stiffness_limit_N_per_m;
};

/// Explains why the force over the stroke says little about this mesh: the tip never cuts, or first cuts
/// within the last twentieth of the stroke, so that a few per cent of compliance decide whether it cuts at
/// all. Empty otherwise.
std::string cutRemark(const MeshRow& mesh);

/// A rung of a ladder.
struct MeshSize {
  int nodes = 0;  ///< approximate
  int stations = kDefaultStations;
};

/// Studies the same scene, at the same E, on each of these meshes, coarse to fine; limits are for growing
/// nodes, or for growing stations if all rungs have the same nodes. Calls `done` (may be empty) with each
/// mesh before its errors are known. Errors: as `precomputeCompliance`; kInvalidInput when the ladder is
/// empty.
Result<std::vector<MeshRow>> meshStudy(const SceneSpec& spec, const std::vector<MeshSize>& ladder,
                                       const std::function<void(const MeshRow&)>& done = {});

}  // namespace needlelab
