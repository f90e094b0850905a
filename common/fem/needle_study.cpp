#include "common/fem/needle_study.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "common/base/time/clock.h"
#include "common/haptics/engine.h"

namespace needlelab {
namespace {

constexpr double kStrokeRate_hz = 1000;
/// Step of the quasi-static insertion behind a table.
constexpr double kTableStep_m = 2e-5;
/// The shortest cut that is not a rounding error.
constexpr double kCut_m = 1e-6;
/// A first cut within this last share of a stroke determines the whole way out.
constexpr double kLateShare = 0.05;

// minimum jerk from 0 to 1
double smooth(double t) {
  return t * t * t * (10.0 + t * (-15.0 + 6.0 * t));
}

NeedlePose straightAt(double depth_m) {
  return {depth_m, std::max(0.0, depth_m), 1.0};
}

double totalOf(const NeedleForce& force) {
  return force.cutting_N + force.friction_N;
}

// a point of the surface and the direction into the tissue there
struct Entry {
  Vec3 p_m, inward;
};
Entry entryOf(const Limb& limb) {
  if (const auto* plane = std::get_if<PlaneLimb>(&limb)) return {plane->point_m, -normalized(plane->normal)};
  if (const auto* sphere = std::get_if<SphereLimb>(&limb))
    return {sphere->center_m + Vec3{0, 0, sphere->radius_m}, {0, 0, -1}};
  // FEM needs layers: validate() refuses a body
  const auto& capsule = std::get<CapsuleLimb>(limb);
  const Vec3 along = normalized(capsule.b_m - capsule.a_m);
  const Vec3 any = std::fabs(along.z) < 0.9 ? Vec3{0, 0, 1} : Vec3{1, 0, 0};
  const Vec3 outward = normalized(any - along * dot(any, along));
  return {0.5 * (capsule.a_m + capsule.b_m) + outward * capsule.radius_m, -outward};
}

// shortest rotation from +z to `axis`
Quat pointingAlong(Vec3 axis) {
  if (axis.z < -1 + 1e-9) return {1, 0, 0, 0};
  const Vec3 c = cross({0, 0, 1}, axis);
  return normalized(Quat{c.x, c.y, c.z, 1 + axis.z});
}

double meanSquare(const std::vector<double>& values, std::size_t from, std::size_t to) {
  double sum = 0;
  for (std::size_t i = from; i < to; ++i) sum += values[i] * values[i];
  return to > from ? sum / static_cast<double>(to - from) : 0.0;
}

}  // namespace

std::vector<double> strokeOf(double depth_m, double seconds, double hold_s) {
  std::vector<double> depths;
  const auto ticks = static_cast<int>(seconds * kStrokeRate_hz);
  for (int k = 1; k <= ticks; ++k) depths.push_back(depth_m * smooth(static_cast<double>(k) / ticks));
  depths.insert(depths.end(), static_cast<std::size_t>(hold_s * kStrokeRate_hz), depth_m);
  for (int k = 1; k < ticks; ++k) depths.push_back(depth_m * smooth(1.0 - static_cast<double>(k) / ticks));
  return depths;
}

std::vector<double> forcesOn(const FemNeedle& needle, const std::vector<double>& depth_m) {
  NeedleState state{};
  std::vector<double> forces;
  forces.reserve(depth_m.size());
  for (const double depth : depth_m) forces.push_back(totalOf(stepNeedle(needle, straightAt(depth), state)));
  return forces;
}

double studyDepth(const SceneSpec& spec) {
  double layers_m = 0;
  for (const LayerSpec& layer : spec.layers) layers_m += layer.thickness_m;
  const double last = spec.layers.empty() ? 0.0 : spec.layers.back().thickness_m;
  return std::min(0.95 * spec.needle_length_m, layers_m - 0.1 * last);
}

Result<std::vector<PrecomputedSpec::Row>> forceTable(const SceneSpec& spec, double depth_m, int rows) {
  if (!spec.fem.compliance)
    return Error{ErrorCode::kInvalidInput, "force table: the scene's mesh was not computed"};
  if (rows < 2 || rows > 1024)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("force table: {} rows are out of range [2, 1024]", rows)};
  const FemNeedle needle = compileNeedle(spec);
  std::vector<PrecomputedSpec::Row> table(static_cast<std::size_t>(rows));
  NeedleState state{};
  double at = 0;
  const auto goTo = [&](double depth) {
    const int steps = std::max(1, static_cast<int>(std::ceil(std::fabs(depth - at) / kTableStep_m)));
    NeedleForce force;
    const double from = at;
    for (int k = 1; k <= steps; ++k) {
      at = from + (depth - from) * k / steps;
      force = stepNeedle(needle, straightAt(at), state);
    }
    at = depth;
    return totalOf(force);
  };
  for (std::size_t r = 0; r < table.size(); ++r) {
    table[r].depth_m = depth_m * static_cast<double>(r) / (rows - 1);
    table[r].cutting_N = std::max(0.0, -goTo(table[r].depth_m));
  }
  for (std::size_t r = table.size(); r-- > 0;) table[r].attracted_N = std::max(0.0, goTo(table[r].depth_m));
  return table;
}

Result<TableError> tableError(const SceneSpec& fem, const SceneSpec& table, double rate_hz) {
  constexpr double kOutside_m = 0.002;
  const auto fem_model = compile(fem, rate_hz);
  if (!fem_model.ok()) return fem_model.error();
  const auto table_model = compile(table, rate_hz);
  if (!table_model.ok()) return table_model.error();

  const Entry entry = entryOf(fem.limb);
  const Quat q = pointingAlong(entry.inward);
  const double depth = studyDepth(fem);
  const auto ticks = static_cast<int>(2.0 * rate_hz), hold = static_cast<int>(0.2 * rate_hz);
  auto fem_state = std::make_unique<SimState>(), table_state = std::make_unique<SimState>();
  StepReport fem_report, table_report;
  TableError error;
  std::vector<double> difference;
  std::size_t in_end = 0, hold_end = 0;
  for (int k = 0; k <= 2 * ticks + hold; ++k) {
    const double share = k <= ticks          ? static_cast<double>(k) / ticks
                         : k <= ticks + hold ? 1.0
                                             : static_cast<double>(2 * ticks + hold - k) / ticks;
    const double at = -kOutside_m + (depth + kOutside_m) * smooth(share);
    const TipSample sample{entry.p_m + entry.inward * at, q};
    step(*fem_model, sample, *fem_state, fem_report);
    step(*table_model, sample, *table_state, table_report);
    if (fem_report.phase == Phase::kFree) continue;
    error.depth_m.push_back(at);
    error.fem_N.push_back(dot(fem_report.wrench_W.force_N, entry.inward));
    error.table_N.push_back(dot(table_report.wrench_W.force_N, entry.inward));
    difference.push_back(error.table_N.back() - error.fem_N.back());
    error.fem_peak_N = std::max(error.fem_peak_N, std::fabs(error.fem_N.back()));
    if (std::fabs(difference.back()) > error.max_N) {
      error.max_N = std::fabs(difference.back());
      error.max_depth_m = at;
    }
    if (k <= ticks) in_end = difference.size();
    if (k <= ticks + hold) hold_end = difference.size();
  }
  error.rms_N = std::sqrt(meanSquare(difference, 0, difference.size()));
  error.in_rms_N = std::sqrt(meanSquare(difference, 0, in_end));
  error.hold_rms_N = std::sqrt(meanSquare(difference, in_end, hold_end));
  error.out_rms_N = std::sqrt(meanSquare(difference, hold_end, difference.size()));
  return error;
}

namespace {

// forces over the stroke, each step timed
std::vector<double> timedStroke(const FemNeedle& needle, const std::vector<double>& depth_m, MeshRow& row) {
  NeedleState state{};
  std::vector<double> forces, seconds;
  Stopwatch watch;
  double at_m = 0;
  for (const double depth : depth_m) {
    watch.lap();
    const NeedleForce force = stepNeedle(needle, straightAt(depth), state);
    seconds.push_back(watch.lap());
    forces.push_back(totalOf(force));
    row.work_J += forces.back() * (depth - at_m);
    at_m = depth;
    row.stroke_m = std::max(row.stroke_m, depth);
    if (row.first_cut_m) continue;
    if (state.cut_m > kCut_m) {
      row.first_cut_m = depth;
      row.cut_share = 1;
    } else if (state.tip_most_N > 0) {
      row.cut_share = std::max(row.cut_share, state.tip_N / state.tip_most_N);
    }
  }
  std::sort(seconds.begin(), seconds.end());
  row.live_step_p50_s = seconds[seconds.size() / 2];
  row.live_step_p99_s = seconds[seconds.size() * 99 / 100];
  row.live_step_max_s = seconds.back();
  return forces;
}

void compare(const std::vector<double>& depth_m, const std::vector<double>& forces,
             const std::vector<double>& finest, MeshRow& row) {
  double sum = 0;
  for (std::size_t k = 0; k < forces.size(); ++k) {
    const double error = std::fabs(forces[k] - finest[k]);
    sum += error * error;
    if (error <= row.force_max_error_N) continue;
    row.force_max_error_N = error;
    row.force_max_depth_m = depth_m[k];
    row.force_max_out = k > 0 && depth_m[k] < depth_m[k - 1];
  }
  row.force_rms_error_N = std::sqrt(sum / static_cast<double>(forces.size()));
}

double rmsDifference(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> difference(a.size());
  for (std::size_t k = 0; k < a.size(); ++k) difference[k] = a[k] - b[k];
  return std::sqrt(meanSquare(difference, 0, difference.size()));
}

// Richardson's estimate at the last of three meshes, `first` and `second` being the changes between them.
// With Q(n) = Q∞ + A n^−q, a = ln n2/n1 and b = ln n3/n2: first/second = (e^(qa) − 1)/(1 − e^(−qb)), which
// grows with q from a/b at q = 0; and the rest is second/(e^(qb) − 1).
MeshLimit limitOfThree(const int* nodes, double first, double second) {
  constexpr double kMaxOrder = 10;
  MeshLimit limit;
  if (nodes[1] <= nodes[0] || nodes[2] <= nodes[1]) return limit;
  const double a = std::log(static_cast<double>(nodes[1]) / nodes[0]),
               b = std::log(static_cast<double>(nodes[2]) / nodes[1]);
  if (second == 0) {
    limit.converges = true;
    limit.order = kMaxOrder;
    return limit;
  }
  const double ratio = first / second;
  if (!(ratio > a / b)) return limit;
  double low = 0, high = kMaxOrder;
  for (int k = 0; k < 60; ++k) {
    const double q = 0.5 * (low + high);
    (std::expm1(q * a) / -std::expm1(-q * b) < ratio ? low : high) = q;
  }
  limit.converges = true;
  limit.order = high;
  limit.rest = second / std::expm1(high * b);
  return limit;
}

void addLimits(const std::vector<std::vector<double>>& forces, std::vector<MeshRow>& rows) {
  const bool same_mesh = rows.size() > 1 && rows.front().nodes == rows.back().nodes;
  std::vector<int> nodes;
  for (const MeshRow& row : rows) nodes.push_back(same_mesh ? row.stations : row.nodes);
  std::vector<double> force_N, work_J, stiffness_N_per_m;
  for (std::size_t r = 0; r + 1 < rows.size(); ++r) {
    force_N.push_back(rmsDifference(forces[r], forces[r + 1]));
    work_J.push_back(rows[r + 1].work_J - rows[r].work_J);
    stiffness_N_per_m.push_back(rows[r + 1].stiffness_N_per_m - rows[r].stiffness_N_per_m);
  }
  const auto of_force = limitsOf(nodes, force_N), of_work = limitsOf(nodes, work_J),
             of_stiffness = limitsOf(nodes, stiffness_N_per_m);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    rows[r].force_limit_N = of_force[r];
    rows[r].work_limit_J = of_work[r];
    rows[r].stiffness_limit_N_per_m = of_stiffness[r];
  }
}

}  // namespace

Result<double> scaleToTipStiffness(SceneSpec& spec, double stiffness_N_per_m) {
  if (!(stiffness_N_per_m > 0))
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("tip stiffness: {} N/m is not above 0", stiffness_N_per_m)};
  NeedleMeshOptions options;
  options.nodes = spec.fem.nodes;
  SceneSpec with_mesh = spec;
  ASSIGN_OR_RETURN(with_mesh.fem.compliance, precomputeCompliance(spec, options));
  const double factor = tipGive_m_per_N(compileNeedle(with_mesh), 0.0) * stiffness_N_per_m;
  for (FemLayerSpec& layer : spec.fem.layers) layer.young_Pa *= factor;
  spec.fem.compliance = nullptr;
  return factor;
}

Result<FemScene> femLikeForLike(const SceneSpec& scene, int nodes) {
  if (std::holds_alternative<BodyLimb>(scene.limb))
    return Error{
        ErrorCode::kInvalidInput,
        "volume: FEM computes layers that lie flat under the skin: use a profile with a limb and layers"};
  FemScene fem{likeForLike(scene, AxialModel::kFem)};
  if (!scene.fem.layers.empty()) return fem;
  fem.spec.fem.nodes = nodes;
  ASSIGN_OR_RETURN(fem.young_factor, scaleToTipStiffness(fem.spec, scene.tracking_wall.stiffness_N_per_m));
  return fem;
}

std::vector<std::optional<MeshLimit>> limitsOf(const std::vector<int>& nodes,
                                               const std::vector<double>& changes) {
  std::vector<std::optional<MeshLimit>> limits(nodes.size());
  for (std::size_t r = 2; r < nodes.size(); ++r) {
    MeshLimit limit = limitOfThree(&nodes[r - 2], changes[r - 2], changes[r - 1]);
    // the previous mesh's rest should equal this change plus this mesh's rest
    if (const auto& before = limits[r - 1]; limit.converges && before && before->converges)
      limit.error = std::fabs(changes[r - 1] + limit.rest - before->rest);
    limits[r] = limit;
  }
  return limits;
}

std::string cutRemark(const MeshRow& mesh) {
  if (!mesh.first_cut_m)
    return fmt::format(
        "the tip never cuts in this stroke (it reaches {:.3g} % of the cutting force): the force hangs on "
        "whether it cuts",
        100 * mesh.cut_share);
  if (*mesh.first_cut_m < (1 - kLateShare) * mesh.stroke_m) return {};
  return fmt::format(
      "the tip first cuts at {:.3g} mm of a stroke of {:.3g} mm: the force hangs on whether it cuts",
      1e3 * *mesh.first_cut_m, 1e3 * mesh.stroke_m);
}

Result<std::vector<MeshRow>> meshStudy(const SceneSpec& spec, const std::vector<MeshSize>& ladder,
                                       const std::function<void(const MeshRow&)>& done) {
  if (ladder.empty()) return Error{ErrorCode::kInvalidInput, "mesh study: no mesh sizes given"};
  const std::vector<double> stroke = strokeOf(studyDepth(spec));
  std::vector<MeshRow> rows;
  std::vector<std::vector<double>> forces;
  for (const MeshSize& size : ladder) {
    NeedleMeshOptions options;
    options.nodes = size.nodes;
    options.stations = size.stations;
    SolveTimes solves;
    options.time_solves = &solves;
    Stopwatch watch;
    const auto compliance = precomputeCompliance(spec, options);
    if (!compliance.ok()) return compliance.error();
    MeshRow row;
    const NeedleCompliance& mesh = **compliance;
    row.precompute_s = watch.lap() - solves.all_s;
    row.nodes = mesh.nodes;
    row.elements = mesh.elements;
    row.stations = size.stations;
    row.assemble_s = mesh.assemble_s;
    row.factor_s = mesh.factor_s;
    row.solve_s = mesh.solve_s;
    row.one_solve = solves;
    row.strained_share = mesh.strained_share;
    row.strained_near_share = mesh.strained_near_share;

    SceneSpec with_mesh = spec;
    with_mesh.fem.compliance = *compliance;
    const FemNeedle needle = compileNeedle(with_mesh);
    row.stiffness_N_per_m = needle.stiffness_N_per_m;
    row.tip_give_m_per_N = tipGive_m_per_N(needle, 0.5 * spec.needle_length_m);
    forces.push_back(timedStroke(needle, stroke, row));
    const auto at_1mm =
        std::lower_bound(stroke.begin(), std::max_element(stroke.begin(), stroke.end()), 1e-3);
    row.at_1mm_N = forces.back()[static_cast<std::size_t>(at_1mm - stroke.begin())];
    if (done) done(row);
    rows.push_back(row);
  }
  const MeshRow finest = rows.back();
  for (std::size_t r = 0; r < rows.size(); ++r) {
    rows[r].stiffness_error = rows[r].stiffness_N_per_m / finest.stiffness_N_per_m - 1;
    rows[r].tip_give_error = rows[r].tip_give_m_per_N / finest.tip_give_m_per_N - 1;
    compare(stroke, forces[r], forces.back(), rows[r]);
  }
  addLimits(forces, rows);
  return rows;
}

}  // namespace needlelab
