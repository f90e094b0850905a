/// `needlelab-sim run`: a trajectory through the engine, tick by tick.
#include <cinttypes>
#include <cstdio>
#include <memory>

#include "base/atomic_file.h"
#include "base/exit_code.h"
#include "sim/command.h"
#include "sim/offline_cli.h"
#include "sim/run_output.h"

namespace needlelab {
namespace {

struct RunOptions {
  OfflineOptions input;
  std::filesystem::path out;
  bool hash = false;
};

int fail(const Error& error) {
  std::fprintf(stderr, "needlelab-sim run: %s\n", error.message.c_str());
  return exitCodeOf(error);
}

int run(const RunOptions& options) {
  if (const Status status = checkOutput(options.input, options.out, "--out"); !status.ok())
    return fail(status.error());
  const auto scene = loadOffline(options.input);
  if (!scene.ok()) return fail(scene.error());
  sayWarnings(*scene);

  constexpr std::size_t kTypicalRow = 400;
  std::string table(runHeader());
  table.reserve(table.size() + kTypicalRow * scene->track.t_s.size());
  auto state = std::make_unique<SimState>();
  StepReport report;
  for (std::size_t i = 0; i < scene->track.t_s.size(); ++i) {
    step(scene->model, scene->tip(i), *state, report);
    appendRunRow(table, scene->track.t_s[i], report, scene->model.needle_length_m);
  }
  if (const Status status = writeFileAtomically(options.out, viewOf(table)); !status.ok())
    return fail(status.error());
  if (options.hash) std::printf("%016" PRIx64 "\n", fnv1a(table));
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
  command->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace needlelab
