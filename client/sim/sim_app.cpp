#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <string>

#include "client/sim/command.h"
#include "common/base/program.h"

namespace needlelab {

int failed(const char* command, const Error& error) {
  std::fprintf(stderr, "needlelab-sim %s: %s\n", command, error.message.c_str());
  return exitCodeOf(error);
}

int runSim(int argc, const char* const* argv) {
  try {
    CLI::App app{"needlelab-sim: the haptic engine without a device"};
    app.require_subcommand(1);
    SimCommand chosen;
    addRunCommand(app, chosen);
    addFiguresCommand(app, chosen);
    addPrecomputeCommand(app, chosen);
    addScoreCommand(app, chosen);
    addAccuracyCommand(app, chosen);
    addBenchmarkCommand(app, chosen);
    addSkillCommand(app, chosen);
    addStabilityCommand(app, chosen);
    addEffectsCommand(app, chosen);
    const std::string version = std::string("needlelab-sim ") + NEEDLELAB_VERSION;
    app.set_version_flag("--version", version);
    for (CLI::App* command : app.get_subcommands({})) command->set_version_flag("--version", version);
    try {
      app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
      // 0 for --help and --version; all other codes of CLI11 mean wrong usage here
      return afterOutput(app.exit(e) == 0 ? kExitDone : kExitInvalid, "needlelab-sim");
    }
    return afterOutput(chosen(), "needlelab-sim");
  } catch (const std::exception& e) {
    // out of memory or a file system error: report one line, never a trace
    std::fprintf(stderr, "needlelab-sim: %s\n", e.what());
    return kExitFailed;
  }
}

}  // namespace needlelab
