/// `needlelab-sim precompute`: finite elements offline, into a table that the tracking wall renders at its
/// own cost (the paper's future work).
#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "client/sim/command.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/range.h"
#include "common/base/time/clock.h"
#include "common/fem/needle_mesh.h"
#include "common/fem/needle_study.h"
#include "common/haptics/models/like_for_like.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab {
namespace {

struct PrecomputeOptions {
  std::filesystem::path profile, out;
  int nodes = 30'000, stations = kDefaultStations, rows = 501;
  bool replace = false;
  double depth_m = 0;  ///< 0: as deep as the needle or the layers allow
  JsonOption json;
};

Status checkOptions(const PrecomputeOptions& options) {
  const auto check = [](const char* option, double value, const NumberRange& range) -> Status {
    if (range.contains(value)) return {};
    return outOfRange(option, value, range);
  };
  for (const Status& status :
       {check("--mesh", options.nodes, {100, 200'000}),
        check("--stations", options.stations, {1, kMaxNeedleStations}),
        check("--rows", options.rows, {2, 1024}), check("--depth in m", options.depth_m, {0, 1})})
    if (!status.ok()) return status;
  if (options.out.empty()) return Error{ErrorCode::kInvalidInput, "--out: is empty; give the name of a file"};
  RETURN_IF_ERROR(checkOutputs({{"--profile", options.profile}},
                               {{"--out", options.out}, {"--json", options.json.file}}));
  return requireNewFile({"--out", options.out}, options.replace);
}

// 1 µN and 0.1 µm: finer steps are meaningless, and 17 digits are unreadable
double rounded(double value, double per_unit) {
  return std::round(value * per_unit) / per_unit;
}

// Reports the table's error on the way out if a hand would notice it: 7 % of a force from 2.5 N up (the
// literature: between 2.5 and 10 N), and not less below. Otherwise empty.
std::string withdrawalRemark(const TableError& error) {
  if (error.out_rms_N <= 0.07 * std::max(error.fem_peak_N, 2.5)) return {};
  return fmt::format(
      "misses the withdrawal by {:.2f} N (rms) of a peak of {:.2f} N: a table knows depth and direction, not "
      "what the shaft remembers; take FEM where the way out is felt or scored",
      error.out_rms_N, error.fem_peak_N);
}

// The profile with its table; checks all numbers for the renderable range before writing.
Result<pb::Profile> profileWithTable(const pb::Profile& from, SceneSpec table, const std::string& source) {
  pb::Profile profile = from;
  table.axial_model = AxialModel::kPrecomputed;
  // the table includes cutting, attraction and shaft friction
  table.effects |= bitOf(Effect::kCutting) | bitOf(Effect::kAttracted);
  table.effects &= ~bitOf(Effect::kShaftFriction);
  RETURN_IF_ERROR(validate(table));
  putModel(table, profile);
  profile.mutable_precomputed()->set_source(source);
  const std::string suffix = "-precomputed";
  profile.set_id(profile.id().substr(0, 64 - suffix.size()) + suffix);
  profile.set_name(profile.name().substr(0, 170) + " (FEM, precomputed)");
  return parseProfile(profileJson(profile), "the new profile");
}

// Describes the origin of E.
std::string elasticityOf(const SceneSpec& scene, double young_factor) {
  if (!scene.fem.layers.empty()) return "elasticity is that of the profile's section fem";
  return fmt::format(
      "elasticity was set, not measured: the layers' lateral stiffness gives E (10 kPa where it is 0), times "
      "{:.3g} in all layers, so that the tip meets the walls' {:.4g} N/m at the skin",
      young_factor, scene.tracking_wall.stiffness_N_per_m);
}

int precompute(const PrecomputeOptions& options) {
  if (const Status status = checkOptions(options); !status.ok()) return failed("precompute", status.error());
  const auto profile = loadProfile(options.profile);
  if (!profile.ok()) return failed("precompute", profile.error());
  const auto scene = sceneSpecOf(*profile);
  if (!scene.ok())
    return failed("precompute",
                  {scene.error().code, options.profile.string() + ": " + scene.error().message});

  // finite elements
  const bool progress = ::isatty(STDERR_FILENO) != 0;
  if (progress) std::fprintf(stderr, "mesh of about %d nodes …\n", options.nodes);
  Stopwatch watch;
  auto like = femLikeForLike(*scene, std::min(options.nodes, kDefaultFemNodes));
  if (!like.ok())
    return failed("precompute", {like.error().code, options.profile.string() + ": " + like.error().message});
  const std::string elasticity = elasticityOf(*scene, like->young_factor);
  if (scene->fem.layers.empty())
    std::fprintf(
        stderr, "needlelab-sim precompute: %s has no section fem: %s; cutting and friction are the layers'\n",
        options.profile.c_str(), elasticity.c_str());
  SceneSpec& fem = like->spec;
  fem.fem.nodes = options.nodes;
  NeedleMeshOptions mesh_options;
  mesh_options.nodes = options.nodes;
  mesh_options.stations = options.stations;
  const auto compliance = precomputeCompliance(fem, mesh_options);
  if (!compliance.ok())
    return failed("precompute",
                  {compliance.error().code, options.profile.string() + ": " + compliance.error().message});
  fem.fem.compliance = *compliance;
  const double mesh_s = watch.lap();

  // the table
  const double depth_m = options.depth_m > 0 ? options.depth_m : studyDepth(fem);
  if (progress) std::fprintf(stderr, "insertion to %.1f mm and out …\n", 1e3 * depth_m);
  const auto rows = forceTable(fem, depth_m, options.rows);
  if (!rows.ok()) return failed("precompute", rows.error());
  if (std::none_of(rows->begin(), rows->end(),
                   [](const PrecomputedSpec::Row& row) { return row.cutting_N > 0 || row.attracted_N > 0; }))
    return failed(
        "precompute",
        {ErrorCode::kInvalidInput,
         options.profile.string() +
             ": nothing in it cuts or rubs, so every force of the table would be 0; give cutting_n and "
             "friction_n_per_m in fem.layers, or cutting_force_n and friction_n_per_m in layers"});
  SceneSpec table = *scene;
  table.precomputed.table.clear();
  for (const PrecomputedSpec::Row& row : *rows)
    table.precomputed.table.push_back(
        {rounded(row.depth_m, 1e7), rounded(row.cutting_N, 1e6), rounded(row.attracted_N, 1e6)});
  const double table_s = watch.lap();

  const std::string source = fmt::format(
      "needlelab-sim precompute of profile {}: {}; quasi-static to {:.4g} m and out. Cutting and friction "
      "are inputs; {}; {:.0f} % of the elements are strained above 10 %, where linear elasticity does not "
      "hold",
      profile->id(), (*compliance)->source, depth_m, elasticity, 100 * (*compliance)->strained_share);
  const auto made = profileWithTable(*profile, table, source);
  if (!made.ok()) return failed("precompute", made.error());
  if (const Status status = writeFileAtomically(options.out, viewOf(profileJson(*made))); !status.ok())
    return failed("precompute", status.error());

  // error of the table, printed at once
  const auto written = sceneSpecOf(*made);
  if (!written.ok()) return failed("precompute", written.error());
  const auto error = tableError(fem, *written);
  if (!error.ok()) return failed("precompute", error.error());
  const std::string remark = withdrawalRemark(*error);
  if (!remark.empty())
    std::fprintf(stderr, "needlelab-sim precompute: %s: the table %s\n", options.out.c_str(), remark.c_str());
  if (!options.json.wanted) {
    std::printf(
        "%s: %zu rows to %.1f mm from %d nodes in %.1f s; against FEM live over the same stroke: %.3f N "
        "rms (in %.3f, hold %.3f, out %.3f), %.3f N at most, of a peak of %.3f N\n",
        options.out.c_str(), rows->size(), 1e3 * depth_m, (*compliance)->nodes, mesh_s + table_s,
        error->rms_N, error->in_rms_N, error->hold_rms_N, error->out_rms_N, error->max_N, error->fem_peak_N);
    return kExitDone;
  }
  const nlohmann::ordered_json row = {
      {"profile", made->id()},
      {"out", options.out.string()},
      {"nodes", (*compliance)->nodes},
      {"stations", options.stations},
      {"table_rows", rows->size()},
      {"depth_m", depth_m},
      {"mesh_s", mesh_s},
      {"table_s", table_s},
      {"young_factor", like->young_factor},
      {"strained_share", (*compliance)->strained_share},
      {"error_rms_n", error->rms_N},
      {"error_in_rms_n", error->in_rms_N},
      {"error_hold_rms_n", error->hold_rms_N},
      {"error_out_rms_n", error->out_rms_N},
      {"error_max_n", error->max_N},
      {"fem_peak_n", error->fem_peak_N},
      {"remark", remark.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(remark)}};
  if (const Status status = writeJson(options.json, nlohmann::ordered_json::array({row})); !status.ok())
    return failed("precompute", status.error());
  return kExitDone;
}

}  // namespace

void addPrecomputeCommand(CLI::App& app, SimCommand& chosen) {
  auto options = std::make_shared<PrecomputeOptions>();
  CLI::App* command = app.add_subcommand(
      "precompute", "Finite elements offline: a profile whose force table the tracking wall renders");
  command->add_option("--profile", options->profile, "the scene, with or without a section fem")->required();
  command->add_option("--mesh", options->nodes, "nodes of the mesh, about")->capture_default_str();
  command->add_option("--out", options->out, "the profile that is written, axial_model PRECOMPUTED")
      ->required();
  command->add_flag("--replace", options->replace, "allow --out to overwrite an existing file");
  command->add_option("--stations", options->stations, "pieces of the needle's path")->capture_default_str();
  command->add_option("--rows", options->rows, "rows of the table")->capture_default_str();
  command->add_option("--depth", options->depth_m, "how deep in m; 0: as far as needle and layers allow")
      ->capture_default_str();
  addJsonOption(*command, options->json);
  command->callback([options, &chosen] { chosen = [options] { return precompute(*options); }; });
}

}  // namespace needlelab
