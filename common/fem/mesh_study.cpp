#include "common/fem/mesh_study.h"

#include <algorithm>
#include <cmath>

#include "common/fem/needle_stroke.h"
#include "common/fem/stopwatch.h"

namespace needlelab {
namespace {

// forces over the stroke, each step timed
std::vector<double> timedStroke(const FemNeedle& needle, const std::vector<double>& depth_m, MeshRow& row) {
  NeedleState state{};
  std::vector<double> forces, seconds;
  Stopwatch watch;
  for (const double depth : depth_m) {
    watch.lap();
    const NeedleForce force = stepNeedle(needle, {depth, depth, 1.0}, state);
    seconds.push_back(watch.lap());
    forces.push_back(force.cutting_N + force.friction_N);
  }
  std::sort(seconds.begin(), seconds.end());
  row.live_step_p50_s = seconds[seconds.size() / 2];
  row.live_step_p99_s = seconds[seconds.size() * 99 / 100];
  row.live_step_max_s = seconds.back();
  return forces;
}

void compare(const std::vector<double>& forces, const std::vector<double>& finest, MeshRow& row) {
  double sum = 0;
  for (std::size_t k = 0; k < forces.size(); ++k) {
    const double error = std::fabs(forces[k] - finest[k]);
    sum += error * error;
    row.force_max_error_N = std::max(row.force_max_error_N, error);
  }
  row.force_rms_error_N = std::sqrt(sum / static_cast<double>(forces.size()));
}

}  // namespace

Result<std::vector<MeshRow>> meshStudy(const SceneSpec& spec, const std::vector<int>& ladder, int stations,
                                       const std::function<void(const MeshRow&)>& done) {
  if (ladder.empty()) return Error{ErrorCode::kInvalidInput, "mesh study: no mesh sizes given"};
  const std::vector<double> stroke = strokeOf(studyDepth(spec));
  std::vector<MeshRow> rows;
  std::vector<std::vector<double>> forces;
  for (const int nodes : ladder) {
    NeedleMeshOptions options;
    options.nodes = nodes;
    options.stations = stations;
    Stopwatch watch;
    const auto compliance = precomputeCompliance(spec, options);
    if (!compliance.ok()) return compliance.error();
    MeshRow row;
    row.precompute_s = watch.lap();
    const NeedleCompliance& mesh = **compliance;
    row.nodes = mesh.nodes;
    row.elements = mesh.elements;
    row.stations = stations;
    row.assemble_s = mesh.assemble_s;
    row.factor_s = mesh.factor_s;
    row.solve_s = mesh.solve_s;
    row.one_solve_s = mesh.one_solve_s;
    row.strained_share = mesh.strained_share;
    row.strained_near_share = mesh.strained_near_share;

    SceneSpec with_mesh = spec;
    with_mesh.fem.compliance = *compliance;
    const FemNeedle needle = compileNeedle(with_mesh);
    row.stiffness_N_per_m = needle.stiffness_N_per_m;
    row.tip_give_m_per_N = tipGive_m_per_N(needle, 0.5 * spec.needle_length_m);
    forces.push_back(timedStroke(needle, stroke, row));
    if (done) done(row);
    rows.push_back(row);
  }
  const MeshRow finest = rows.back();
  for (std::size_t r = 0; r < rows.size(); ++r) {
    rows[r].stiffness_error = rows[r].stiffness_N_per_m / finest.stiffness_N_per_m - 1;
    rows[r].tip_give_error = rows[r].tip_give_m_per_N / finest.tip_give_m_per_N - 1;
    compare(forces[r], forces.back(), rows[r]);
  }
  return rows;
}

}  // namespace needlelab
