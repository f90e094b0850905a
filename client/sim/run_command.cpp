/// `needlelab-sim run`: a trajectory through the engine, tick by tick.
#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "client/sim/command.h"
#include "client/sim/tools/json_output.h"
#include "client/sim/tools/offline_scene.h"
#include "client/sim/tools/run_table.h"
#include "common/base/files.h"
#include "common/base/program.h"

namespace needlelab {
namespace {

struct RunOptions {
  OfflineOptions input;
  std::filesystem::path out;
  bool hash = false;
  JsonOption json;
};

// sums and maxima over the whole run
struct RunTotals {
  std::size_t ticks = 0, insertions = 0;
  double max_force_N = 0, max_torque_Nm = 0, max_depth_m = 0;

  void add(const StepReport& report) {
    ++ticks;
    if ((report.flags & kFlagEntry) != 0) ++insertions;
    max_force_N = std::max(max_force_N, norm(report.wrench_W.force_N));
    max_torque_Nm = std::max(max_torque_Nm, norm(report.wrench_W.torque_Nm));
    max_depth_m = std::max(max_depth_m, report.depth_m);
  }
};

int run(const RunOptions& options) {
  if (options.out.empty())
    return failed("run", {ErrorCode::kInvalidInput, "--out: is empty; give the name of a file"});
  if (const Status status =
          checkOutputs({{"--profile", options.input.profile}, {"--trajectory", options.input.trajectory}},
                       {{"--out", options.out}, {"--json", options.json.file}});
      !status.ok())
    return failed("run", status.error());
  const auto scene = loadOffline(options.input);
  if (!scene.ok()) return failed("run", scene.error());
  printWarnings(*scene);

  constexpr std::size_t kTypicalRow = 400;
  std::string table(runHeader());
  table.reserve(table.size() + kTypicalRow * scene->track.t_s.size());
  auto state = std::make_unique<SimState>();
  StepReport report;
  RunTotals totals;
  for (std::size_t i = 0; i < scene->track.t_s.size(); ++i) {
    step(scene->model, scene->tip(i), *state, report);
    totals.add(report);
    appendRunRow(table, scene->track.t_s[i], report, scene->model.needle_length_m);
  }
  if (const Status status = writeFileAtomically(options.out, viewOf(table)); !status.ok())
    return failed("run", status.error());
  const std::string hash = fmt::format("{:016x}", fnv1a(table));
  if (options.hash && !options.json.wanted) std::printf("%s\n", hash.c_str());
  if (!options.json.wanted) return kExitDone;
  const nlohmann::ordered_json row = {{"profile", scene->profile.id()},
                                      {"out", options.out.string()},
                                      {"rate_hz", scene->rate_hz},
                                      {"ticks", totals.ticks},
                                      {"insertions", totals.insertions},
                                      {"max_force_n", totals.max_force_N},
                                      {"max_torque_nm", totals.max_torque_Nm},
                                      {"max_depth_m", totals.max_depth_m},
                                      {"hash", hash}};
  if (const Status status = writeJson(options.json, nlohmann::ordered_json::array({row})); !status.ok())
    return failed("run", status.error());
  return kExitDone;
}

}  // namespace

void addRunCommand(CLI::App& app, SimCommand& chosen) {
  auto options = std::make_shared<RunOptions>();
  CLI::App* command =
      app.add_subcommand("run", "Runs a trajectory through the engine, without a device or gate");
  addOfflineOptions(*command, options->input);
  command->add_option("--out", options->out, "the table that is written: forces, wall, phase, … of each tick")
      ->required();
  command->add_flag("--hash", options->hash, "print FNV-1a of the table, to compare builds and machines");
  addJsonOption(*command, options->json);
  command->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace needlelab
