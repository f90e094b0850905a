/// `needlelab-sim run`: runs a trajectory, or a device's recording, through the engine tick by tick.
#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "client/sim/command.h"
#include "client/sim/tools/offline_scene.h"
#include "client/sim/tools/recorded_run.h"
#include "client/sim/tools/run_table.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/gesture/sample.h"
#include "common/gesture/whole_recording.h"
#include "common/haptics/body/body_engine.h"
#include "common/profile/scene_of_profile.h"
#include "common/scoring/motion/part_of_gesture.h"

namespace needlelab {
namespace {

struct RunOptions {
  OfflineOptions input;
  std::filesystem::path recorded;  // instead of a trajectory
  std::filesystem::path out;
  bool hash = false, replace = false;
  JsonOption json;
};

// Sums and maxima over the whole run.
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

// The table of a run, row by row.
struct RunTable {
  std::string text = runHeader();
  RunTotals totals;

  explicit RunTable(std::size_t rows) {
    constexpr std::size_t kTypicalRow = 400;
    text.reserve(text.size() + kTypicalRow * rows);
  }
  void add(double t_s, const StepReport& report, const SceneModel& model) {
    totals.add(report);
    appendRunRow(text, t_s, report, model.needle_length_m);
  }
};

RunTable runTrajectory(const OfflineScene& scene) {
  RunTable table(scene.track.t_s.size());
  SceneEngine engine(scene.model);
  StepReport report;
  for (std::size_t i = 0; i < scene.track.t_s.size(); ++i) {
    engine.step(scene.tip(i), report);
    table.add(scene.track.t_s[i], report, scene.model);
  }
  return table;
}

RunTable runRecorded(const SceneModel& model, const std::vector<GestureSample>& samples,
                     const std::vector<Bytes>& paths, RecordedDifference& difference) {
  RunTable table(samples.size());
  RecordedRun run(model);
  run.takePaths(paths);
  const auto first_ns = static_cast<std::uint64_t>(samples.front().time_ns);
  for (const GestureSample& sample : samples) {
    const auto since_ns = static_cast<std::int64_t>(static_cast<std::uint64_t>(sample.time_ns) - first_ns);
    table.add(static_cast<double>(since_ns) / 1e9, run.step(sample), model);
  }
  difference = run.difference();
  return table;
}

int run(const RunOptions& options) {
  const bool recorded = !options.recorded.empty();
  if (recorded == !options.input.trajectory.empty())
    return failed(
        "run", {ErrorCode::kInvalidInput, "give either --trajectory or --recorded (a device's recording)"});
  if (recorded && !options.input.tool.empty())
    return failed("run", {ErrorCode::kInvalidInput,
                          "--tool: not with --recorded, whose poses are the tip's; leave it out"});
  if (recorded && options.input.reading.bridges_holes)
    return failed("run", {ErrorCode::kInvalidInput, "--damaged: only with --trajectory"});
  if (options.out.empty())
    return failed("run", {ErrorCode::kInvalidInput, "--out: is empty; give the name of a file"});
  if (const Status status = checkOutputs({{"--profile", options.input.profile},
                                          {"--trajectory", options.input.trajectory},
                                          {"--recorded", options.recorded}},
                                         {{"--out", options.out}, {"--json", options.json.file}});
      !status.ok())
    return failed("run", status.error());
  if (const Status status = requireNewFile({"--out", options.out}, options.replace); !status.ok())
    return failed("run", status.error());
  std::vector<GestureSample> samples;
  std::vector<Bytes> paths;
  OfflineOptions input = options.input;
  if (recorded) {
    auto read =
        readRecordedGesture(options.recorded, DamagedRecording::kRefuse, WallColumns::kRead, input.rate_hz);
    if (!read.ok()) return failed("run", read.error());
    if (!read->note.empty()) std::fprintf(stderr, "needlelab-sim: warning: %s\n", read->note.c_str());
    samples = std::move(read->samples);
    paths = std::move(read->paths);
    input.rate_hz = read->rate_hz;
  }
  const auto scene = loadOffline(input);
  if (!scene.ok()) return failed("run", scene.error());
  printWarnings(*scene);
  for (const std::string& hole : scene->track.holes) std::fprintf(stderr, "damaged: %s\n", hole.c_str());
  if (recorded)
    for (const std::string& part : partOfGesture(samples, input.rate_hz.value_or(0)))
      std::fprintf(stderr, "needlelab-sim: warning: %s\n", part.c_str());
  const auto spec = sceneSpecOf(scene->profile, scene->X_WL);
  if (!spec.ok()) return failed("run", spec.error());
  const auto tip = [&](std::size_t i) { return recorded ? tipOf(samples[i]) : scene->tip(i); };
  warnOfDirection("run", spec->limb, recorded ? samples.size() : scene->track.X_WH.size(), tip,
                  recorded ? QuaternionOrder::kSure : QuaternionOrder::kUnsure);

  RecordedDifference difference;
  const RunTable table =
      recorded ? runRecorded(scene->model, samples, paths, difference) : runTrajectory(*scene);
  const RunTotals& totals = table.totals;
  if (const Status status = writeFileAtomically(options.out, viewOf(table.text)); !status.ok())
    return failed("run", status.error());
  const std::string hash = fmt::format("{:016x}", fnv1a(table.text));
  if (!options.json.wanted) {
    if (recorded) std::fputs(differenceText(difference).c_str(), stdout);
    if (options.hash) std::printf("%s\n", hash.c_str());
    return kExitDone;
  }
  nlohmann::ordered_json row = {{"profile", scene->profile.id()},
                                {"out", options.out.string()},
                                {"rate_hz", scene->rate_hz},
                                {"ticks", totals.ticks},
                                {"insertions", totals.insertions},
                                {"max_force_n", totals.max_force_N},
                                {"max_torque_nm", totals.max_torque_Nm},
                                {"max_depth_m", totals.max_depth_m},
                                {"hash", hash}};
  if (!scene->track.holes.empty()) row["holes"] = scene->track.holes;
  if (recorded)
    row.update({{"compared_ticks", difference.compared_ticks},
                {"differing_ticks", difference.differing_ticks},
                {"gate_ticks", difference.gate_ticks},
                {"median_difference_n", difference.median_N},
                {"p99_difference_n", difference.p99_N},
                {"max_difference_n", difference.greatest_N}});
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
  command->get_option("--trajectory")->required(false);
  command->add_option(
      "--recorded", options->recorded,
      "instead of a trajectory: a session's recording, or its samples as CSV (session export --every-tick). Each second "
      "of samples begins with the recorded state (wall, phase, layer, ruptures), then the engine runs by "
      "itself; says how many ticks differ from the recorded force, and by how much");
  command->add_option("--out", options->out, "the table that is written: forces, wall, phase, … of each tick")
      ->required();
  command->add_flag("--replace", options->replace, "allow --out to overwrite an existing file");
  command->add_flag("--hash", options->hash, "print FNV-1a of the table, to compare builds and machines");
  addJsonOption(*command, options->json);
  command->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace needlelab
