#include "common/fem/needle_mesh.h"

#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "common/base/range.h"
#include "common/base/time/clock.h"
#include "common/fem/elasticity.h"
#include "common/fem/needle_box.h"

namespace needlelab {
namespace {

constexpr double kStrainLimit = 0.1;
/// In thinner layers, rounding makes elements look flat.
constexpr double kThinnestLayer_m = 1e-6;
/// Share of the mean added to each station's own compliance: stations may be finer than the mesh, which would
/// make their compliance singular. It lowers the stiffness of a whole needle by 0.1 % to 0.2 %.
constexpr double kOwnGive = 1e-2;

Status checked(const SceneSpec& spec, const NeedleMeshOptions& options) {
  const auto check = [](const std::string& field, double value, const NumberRange& range) -> Status {
    if (range.contains(value)) return {};
    return outOfRange(field, value, range);
  };
  if (spec.layers.empty() || spec.fem.layers.size() != spec.layers.size())
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format("fem.layers: {} given, the scene has {} layers: give one for each, from the skin inward",
                    spec.fem.layers.size(), spec.layers.size())};
  for (std::size_t i = 0; i < spec.layers.size(); ++i) {
    const FemLayerSpec& layer = spec.fem.layers[i];
    const std::string path = fmt::format("fem.layers[{}].", i);
    for (const Status& status :
         {check(path + "young_pa", layer.young_Pa, {100, 1e9}),
          check(path + "poisson", layer.poisson, {0, 0.49}),
          check(path + "friction_n_per_m", layer.friction_N_per_m, {0, 1e4}),
          check(path + "cutting_n", layer.cutting_N, {0, 50}),
          check(fmt::format("layers[{}].thickness_m", i), spec.layers[i].thickness_m, {kThinnestLayer_m, 1})})
      if (!status.ok()) return status;
  }
  for (const Status& status :
       {check("fem.nodes", options.nodes, {100, 200'000}),
        check("stations", options.stations, {1, static_cast<double>(kMaxNeedleStations)}),
        check("needle.length_m", spec.needle_length_m, {10 * options.radius_m, 1}),
        check("needle radius", options.radius_m, {1e-5, 0.01}),
        check("half width per length", options.half_width_per_length, {1, 100})})
    if (!status.ok()) return status;
  return {};
}

NeedleBoxSpec boxOf(const SceneSpec& spec, const NeedleMeshOptions& options) {
  NeedleBoxSpec box;
  box.length_m = spec.needle_length_m;
  box.radius_m = options.radius_m;
  box.half_width_m = options.half_width_per_length * box.length_m;
  box.depth_m = box.length_m + box.half_width_m;
  double top = 0;
  for (std::size_t i = 0; i < spec.layers.size(); ++i) {
    box.top_m.push_back(top);
    box.materials.push_back({spec.fem.layers[i].young_Pa, spec.fem.layers[i].poisson});
    top += spec.layers[i].thickness_m;
  }
  return box;
}

// forces on the stations of a fully inserted, cutting needle: friction on each, cutting on the last
Eigen::VectorXd fullLoad(const SceneSpec& spec, const NeedleBoxSpec& box, std::size_t stations) {
  const double spacing = box.length_m / static_cast<double>(stations);
  Eigen::VectorXd load(static_cast<Eigen::Index>(stations));
  const FemLayerSpec* layer = nullptr;
  for (std::size_t s = 0; s < stations; ++s) {
    const double depth = (static_cast<double>(s) + 0.5) * spacing;
    const auto below = std::upper_bound(box.top_m.begin(), box.top_m.end(), depth) - box.top_m.begin();
    layer = &spec.fem.layers[static_cast<std::size_t>(below) - 1];
    load[static_cast<Eigen::Index>(s)] = layer->friction_N_per_m * spacing;
  }
  load[static_cast<Eigen::Index>(stations) - 1] += layer->cutting_N;
  return load;
}

void measureStrain(const NeedleBox& box, const NeedleBoxSpec& spec, const Eigen::VectorXd& displacement,
                   NeedleCompliance& to) {
  const TetMesh& mesh = box.mesh();
  const double near = 5 * spec.radius_m;
  std::size_t strained = 0;
  double near_volume = 0, strained_volume = 0;
  for (const TetNodes& e : mesh.element) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (std::size_t n = 0; n < 4; ++n) middle += 0.25 * mesh.node_m[static_cast<std::size_t>(e[n])];
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(strainInMiddle(mesh, e, displacement), Eigen::EigenvaluesOnly);
    const bool is_strained = solver.eigenvalues().cwiseAbs().maxCoeff() > kStrainLimit;
    if (is_strained) ++strained;
    if (middle.head<2>().norm() > near || middle.z() > spec.length_m) continue;
    const double volume = volumeOf(mesh, e);
    near_volume += volume;
    if (is_strained) strained_volume += volume;
  }
  to.strained_share = static_cast<double>(strained) / static_cast<double>(mesh.element.size());
  to.strained_near_share = near_volume > 0 ? strained_volume / near_volume : 0;
}

// times one right-hand side after the other, each of a different station
Status timeSolves(const ElasticSolver& solver, const Eigen::SparseMatrix<double>& loads, SolveTimes& to) {
  constexpr double kFor_s = 0.5;
  constexpr std::size_t kMaxSolved = 1000, kRuns = 5;
  to = {};
  std::vector<double> times_ns;
  Stopwatch watch;
  do {
    const Eigen::SparseMatrix<double> load =
        loads.middleCols(static_cast<Eigen::Index>(times_ns.size()) % loads.cols(), 1);
    watch.lap();
    const auto solved = solver.solve(load);
    if (!solved.ok()) return solved.error();
    const double took_s = watch.lap();
    times_ns.push_back(took_s * 1e9);
    to.all_s += took_s;
  } while (to.all_s < kFor_s && times_ns.size() < kMaxSolved);
  const Timing timing = timingOfRuns(times_ns, 1, kRuns);
  to.solves = timing.batches;
  to.p50_s = timing.median_ns * 1e-9;
  to.p99_s = timing.p99_ns * 1e-9;
  return {};
}

}  // namespace

Result<std::shared_ptr<const NeedleCompliance>> precomputeCompliance(const SceneSpec& spec,
                                                                     const NeedleMeshOptions& given) {
  NeedleMeshOptions options = given;
  if (options.radius_m == 0)
    options.radius_m = spec.needle_diameter_m > 0 ? 0.5 * spec.needle_diameter_m : kNeedleRadius_m;
  if (Status status = checked(spec, options); !status.ok()) return status.error();
  const NeedleBoxSpec box_spec = boxOf(spec, options);
  const NeedleBox box(box_spec, options.nodes);
  auto solver = ElasticSolver::make(box.mesh(), box.materials(), box.held());
  if (!solver.ok()) return solver.error();

  const auto stations = static_cast<std::size_t>(options.stations);
  auto compliance = std::make_shared<NeedleCompliance>();
  compliance->spacing_m = box_spec.length_m / options.stations;
  compliance->radius_m = box_spec.radius_m;
  std::vector<double> edges = {0.0};
  for (std::size_t s = 0; s < stations; ++s) {
    compliance->depth_m.push_back((static_cast<double>(s) + 0.5) * compliance->spacing_m);
    edges.push_back(static_cast<double>(s + 1) * compliance->spacing_m);
  }

  // a force on the whole needle is four times that on the meshed quarter
  Stopwatch watch;
  const auto loads = box.surfaceLoads(edges);
  const auto whole = (*solver)->solve(loads);
  if (!whole.ok()) return whole.error();
  const Eigen::MatrixXd displacement = 0.25 * *whole;
  const Eigen::MatrixXd give = loads.transpose() * displacement;
  compliance->solve_s = watch.lap();
  const auto one = (*solver)->solve(loads.leftCols(1));
  if (!one.ok()) return one.error();
  compliance->one_solve_s = watch.lap();
  if (options.time_solves != nullptr) RETURN_IF_ERROR(timeSolves(**solver, loads, *options.time_solves));
  compliance->assemble_s = (*solver)->assembleSeconds();
  compliance->factor_s = (*solver)->factorSeconds();
  const double own_give = kOwnGive * give.diagonal().mean();
  for (std::size_t i = 0; i < stations; ++i)
    for (std::size_t j = 0; j < stations; ++j) {
      const auto row = static_cast<Eigen::Index>(i), column = static_cast<Eigen::Index>(j);
      compliance->give_m_per_N.push_back(0.5 * (give(row, column) + give(column, row)) +
                                         (i == j ? own_give : 0.0));
    }

  compliance->nodes = static_cast<std::int32_t>(box.mesh().node_m.size());
  compliance->elements = static_cast<std::int32_t>(box.mesh().element.size());
  measureStrain(box, box_spec, displacement * fullLoad(spec, box_spec, stations), *compliance);
  const std::string source = fmt::format(
      "linear elasticity, {} nodes, {} ten-node tetrahedra in a quarter of a box held {:.3g} m from the "
      "path, {} stations on r = {:.3g} mm",
      compliance->nodes, compliance->elements, box_spec.half_width_m, options.stations,
      1e3 * options.radius_m);
  compliance->source = source;
  return std::shared_ptr<const NeedleCompliance>(std::move(compliance));
}

Status addCompliance(SceneSpec& spec) {
  if (spec.axial_model != AxialModel::kFem || spec.fem.compliance) return {};
  NeedleMeshOptions options;
  options.nodes = spec.fem.nodes;
  auto compliance = precomputeCompliance(spec, options);
  if (!compliance.ok()) return compliance.error();
  spec.fem.compliance = *std::move(compliance);
  return {};
}

}  // namespace needlelab
