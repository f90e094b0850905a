#include "client/sim/accuracy/study.h"

#include <fmt/core.h>

#include <deque>
#include <string>
#include <utility>

#include "client/sim/accuracy/gesture.h"
#include "client/sim/accuracy/study_models.h"
#include "common/fem/needle_study.h"

namespace needlelab {
namespace {

constexpr double kFemRate_hz = 1000;
constexpr char kScene[] = "paper-six-layers";

// the finest mesh, compiled, and its size
struct Finest {
  SceneModel model;
  int nodes = 0;
  double strained_share = 0;
};
Result<Finest> finestOf(SceneSpec spec, int nodes) {
  NeedleMeshOptions options;
  options.nodes = nodes;
  ASSIGN_OR_RETURN(const auto compliance, precomputeCompliance(spec, options));
  spec.fem.compliance = compliance;
  ASSIGN_OR_RETURN(auto model, compile(spec, kFemRate_hz));
  return Finest{std::move(model), compliance->nodes, compliance->strained_share};
}

std::string reference(const Finest& finest) {
  return fmt::format("FEM of {} nodes, strokes of 0.5-3 mm in the tissue", finest.nodes);
}

AccuracyRow rowOf(const StudyModel& study, const SceneSpec& scene, const SceneModel& model,
                  const Finest& finest, const std::vector<StudyGesture>& strokes, double young_factor) {
  ErrorRuns runs;
  ErrorSum felt;
  double step_N = 0;
  for (const StudyGesture& stroke : strokes) {
    const std::vector<double> asked_N = axialForces(finest.model, stroke);
    runs.add(errorInTissue(model, stroke, axialForces(model, stroke), asked_N));
    step_N = std::max(step_N, greatestStep_N(model, stroke));
    for (const double force_N : asked_N)
      if (force_N != 0) felt.add(force_N);
  }
  AccuracyRow row;
  row.study = AccuracyStudy::kModel;
  row.scene = kScene;
  row.model = axialModelName(study.model);
  row.variant = study.variant;
  row.rate_hz = kFemRate_hz;
  row.reference = reference(finest);
  row.rms_error_n = runs.rms();
  row.max_error_n = runs.max();
  row.rms_error_spread_n = runs.spread();
  row.max_step_n = step_N;
  row.noticeable_n = noticeableForce_N(felt.rms());
  row.own_law = study.model == AxialModel::kFem;
  row.felt_stiffness_N_per_m = feltStiffness_N_per_m(model, study.spec);
  const std::string strained =
      fmt::format("; {:.0f} % of the volume near the path above 10 % strain", 100 * finest.strained_share);
  row.uncertainty = spreadText(runs, "gestures") + strained;
  row.cannot_show =
      "cutting, which is an input of FEM as of every model, and large strains: FEM is linear here. Which "
      "model is nearer to tissue it cannot say: it has " +
      elasticityText(young_factor);
  if (row.own_law)
    row.cannot_show += ". The comparator is a finer copy of this model: no choice follows from this row";
  row.cannot_show += assumptionRemark(study, scene);
  row.cannot_show += stiffnessRemark(*row.felt_stiffness_N_per_m,
                                     feltStiffness_N_per_m(finest.model, study.spec), "the comparator has");
  return row;
}

// "limit -130.5 ± 0.05 mJ (order 1.2)"; "no limit yet" for fewer than three meshes
std::string limitText(const std::optional<MeshLimit>& limit, double value, double scale, const char* unit) {
  if (!limit) return "no limit yet";
  if (!limit->converges) return "does not converge";
  const std::string error = limit->error ? fmt::format("{:.2g}", scale * *limit->error) : "?";
  return fmt::format("limit {:.5g} ± {} {} (order {:.2g})", scale * (value + limit->rest), error, unit,
                     limit->order);
}

std::string forceLimitText(const std::optional<MeshLimit>& limit) {
  if (!limit) return "no limit yet";
  if (!limit->converges) return "does not converge";
  const std::string error = limit->error ? fmt::format("{:.2g}", *limit->error) : "?";
  return fmt::format("{:.2g} ± {} N rms from its limit (order {:.2g})", limit->rest, error, limit->order);
}

// what the comparator misses itself, at the most; where the force does not converge, its last change
double missedByFinest_N(const std::vector<MeshRow>& meshes) {
  const std::optional<MeshLimit>& limit = meshes.back().force_limit_N;
  if (limit && limit->converges) return limit->rest + limit->error.value_or(0);
  return meshes.size() > 1 ? meshes[meshes.size() - 2].force_rms_error_N : 0;
}

AccuracyRow rowOf(const MeshRow& mesh, int finest_nodes, double missed_N, double young_factor) {
  AccuracyRow row;
  row.study = AccuracyStudy::kMesh;
  row.scene = kScene;
  row.model = axialModelName(AxialModel::kFem);
  row.rate_hz = kFemRate_hz;
  row.mesh_nodes = mesh.nodes;
  row.variant = "compliance made before";
  row.reference = fmt::format("the finest mesh, {} nodes, over an insertion and a withdrawal", finest_nodes);
  row.rms_error_n = mesh.force_rms_error_N;
  row.rms_error_spread_n = missed_N;
  row.max_error_n = mesh.force_max_error_N;
  row.precompute_s = mesh.precompute_s;
  row.noticeable_n = noticeableForce_N(0);  // the lower limit: force peaks may hide more
  row.median_ns = mesh.live_step_p50_s * 1e9;
  row.p99_ns = mesh.live_step_p99_s * 1e9;
  row.cpu_share = mesh.live_step_p50_s * kFemRate_hz;
  row.fits_rate = mesh.live_step_p99_s <= 1 / kFemRate_hz;
  row.uncertainty = fmt::format(
      "force {}; work of the stroke {:.5g} mJ, {}; stiffness {:.4g} N/m, {:+.1f} % of the finest, {}; "
      "{:.0f} % of the volume near the path above 10 % strain",
      forceLimitText(mesh.force_limit_N), 1e3 * mesh.work_J,
      limitText(mesh.work_limit_J, mesh.work_J, 1e3, "mJ"), mesh.stiffness_N_per_m,
      100 * mesh.stiffness_error, limitText(mesh.stiffness_limit_N_per_m, mesh.stiffness_N_per_m, 1, "N/m"),
      100 * mesh.strained_near_share);
  if (const std::string remark = cutRemark(mesh); !remark.empty()) row.uncertainty += "; " + remark;
  row.cannot_show = "linear elasticity at large strain, and " + elasticityText(young_factor);
  return row;
}

// the same mesh without its compliance: one right-hand side solved in every tick
AccuracyRow solvedEachTick(AccuracyRow row, const MeshRow& mesh) {
  row.variant = "solved in each tick";
  row.precompute_s.reset();
  row.median_ns = mesh.one_solve.p50_s * 1e9;
  row.p99_ns = mesh.one_solve.p99_s * 1e9;
  row.cpu_share = mesh.one_solve.p50_s * kFemRate_hz;
  row.fits_rate = mesh.one_solve.p99_s <= 1 / kFemRate_hz;
  row.uncertainty +=
      fmt::format("; one solve by the factor that is there, timed {} times", mesh.one_solve.solves);
  return row;
}

}  // namespace

Result<FemScene> femScene() {
  ASSIGN_OR_RETURN(const auto scenes, studyScenes());
  return femLikeForLike(scenes.back().spec);
}

Result<AccuracyRows> modelFemStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                                   std::vector<std::string>& notes) {
  progress("model: the finest FEM", 0);
  ASSIGN_OR_RETURN(const auto fem, femScene());
  const SceneSpec& spec = fem.spec;
  ASSIGN_OR_RETURN(const auto finest, finestOf(spec, 4 * spec.fem.nodes * (options.long_form ? 3 : 1)));
  std::vector<StudyGesture> strokes;
  for (std::uint64_t seed = 1; seed <= (options.long_form ? 16u : 4u); ++seed)
    strokes.push_back(strokeGesture(spec, seed, kFemRate_hz));

  ASSIGN_OR_RETURN(const auto scenes, studyScenes());
  AccuracyRows rows;
  std::deque<SceneModel> compiled;  // keeps its places: the ticks to be timed point to them
  std::vector<TimedTick> ticks;
  const std::vector<StudyModel> models = studyModels(scenes.back().spec);
  for (StudyModel study : models) {
    if (study.model == AxialModel::kFem) study.spec = spec;
    progress(choiceOf(study) + " against FEM",
             static_cast<double>(ticks.size()) / static_cast<double>(models.size()));
    Status made = addCompliance(study.spec);
    auto model = made.ok() ? compile(study.spec, kFemRate_hz) : Result<SceneModel>(made.error());
    if (!model.ok()) {
      notes.push_back("model: " + choiceOf(study) + " is left out: " + model.error().message);
      continue;
    }
    compiled.push_back(*std::move(model));
    rows.push_back(rowOf(study, scenes.back().spec, compiled.back(), finest, strokes, fem.young_factor));
    rows.back().instructions = instructionsOf(options, kScene, study);
    ticks.push_back(timedSteps(compiled.back(), strokes.front()));
  }
  progress("against FEM, timing", 1);
  addCosts(ticks, options, kFemRate_hz, rows);
  return rows;
}

std::string withdrawalRemark(const TableError& error) {
  if (error.out_rms_N <= noticeableForce_N(error.fem_peak_N)) return {};
  return fmt::format(
      "misses the withdrawal by {:.2f} N (rms) of a peak of {:.2f} N: a table knows depth and direction, not "
      "what the shaft remembers; take FEM where the way out is felt or scored",
      error.out_rms_N, error.fem_peak_N);
}

Result<AccuracyRows> tableRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                               std::vector<std::string>& /*notes*/) {
  progress("model: FEM as a table", 0);
  ASSIGN_OR_RETURN(auto scene, femScene());
  SceneSpec& fem = scene.spec;
  RETURN_IF_ERROR(addCompliance(fem));
  SceneSpec table = fem;
  ASSIGN_OR_RETURN(auto forces, forceTable(fem, studyDepth(fem)));
  table.axial_model = AxialModel::kPrecomputed;
  table.precomputed.table = std::move(forces);
  ASSIGN_OR_RETURN(const auto error, tableError(fem, table, kFemRate_hz));

  ASSIGN_OR_RETURN(const auto model, compile(table, kFemRate_hz));
  AccuracyRow row;
  row.study = AccuracyStudy::kModel;
  row.scene = kScene;
  row.model = axialModelName(AxialModel::kPrecomputed);
  row.variant = "table from FEM, as needlelab-sim precompute makes it";
  if (const std::string remark = withdrawalRemark(error); !remark.empty()) row.variant += "; " + remark;
  row.rate_hz = kFemRate_hz;
  row.reference = "live FEM over one straight insertion and withdrawal, the mesh that the table comes from";
  row.rms_error_n = error.rms_N;
  row.max_error_n = error.max_N;
  row.noticeable_n = noticeableForce_N(error.fem_peak_N);
  const std::string text =
      fmt::format("in ± {:.2g} N, hold ± {:.2g} N, out ± {:.2g} N (rms); FEM's peak {:.3g} N", error.in_rms_N,
                  error.hold_rms_N, error.out_rms_N, error.fem_peak_N);
  row.uncertainty = text;
  row.own_law = true;
  row.cannot_show =
      "motions other than one straight stroke: a table knows depth and direction, not what the shaft "
      "remembers; the error of FEM itself, and " +
      elasticityText(scene.young_factor) +
      ". The comparator is what the table was made of: no choice follows from this row";
  const StudyGesture stroke = strokeGesture(fem, 1, kFemRate_hz);
  AccuracyRows rows{row};
  addCosts({timedSteps(model, stroke)}, options, kFemRate_hz, rows);
  return rows;
}

AccuracyRows rowsOf(const std::vector<MeshRow>& meshes, double young_factor) {
  const double missed_N = missedByFinest_N(meshes);
  AccuracyRows rows;
  for (const MeshRow& mesh : meshes) rows.push_back(rowOf(mesh, meshes.back().nodes, missed_N, young_factor));
  for (std::size_t m = 0; m < meshes.size(); ++m) rows.push_back(solvedEachTick(rows[m], meshes[m]));
  return rows;
}

Result<AccuracyRows> meshRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                              std::vector<std::string>& /*notes*/) {
  std::vector<int> ladder = {1000, 2000, 4000, 8000, 16'000, 32'000, 64'000};
  if (options.long_form) ladder.push_back(128'000);
  if (options.full) ladder.push_back(200'000);
  progress(fmt::format("mesh: up to {} nodes", ladder.back()), 0);
  ASSIGN_OR_RETURN(const auto scene, femScene());
  std::size_t done = 0;
  std::vector<MeshSize> sizes;
  for (const int nodes : ladder) sizes.push_back({nodes});
  const auto meshes = meshStudy(scene.spec, sizes, [&](const MeshRow& mesh) {
    ++done;
    progress(fmt::format("mesh: {} nodes done", mesh.nodes),
             static_cast<double>(done) / static_cast<double>(ladder.size()));
  });
  if (!meshes.ok()) return meshes.error();
  return rowsOf(*meshes, scene.young_factor);
}

}  // namespace needlelab
