/// The subcommands of needlelab-sim: each file in this folder named *_command.cpp adds one.
#pragma once

#include <functional>

#include "common/base/result.h"

namespace CLI {
class App;
}

namespace needlelab {

/// Runs the parsed command line; returns the exit code. Messages go to stderr.
using SimCommand = std::function<int()>;

/// Each function adds its subcommand to `app`. Parsing sets `chosen` if the user picks that subcommand. Both
/// must outlive the parsing.
void addAccuracyCommand(CLI::App& app, SimCommand& chosen);
void addBenchmarkCommand(CLI::App& app, SimCommand& chosen);
void addRunCommand(CLI::App& app, SimCommand& chosen);
void addFiguresCommand(CLI::App& app, SimCommand& chosen);
void addPrecomputeCommand(CLI::App& app, SimCommand& chosen);
void addScoreCommand(CLI::App& app, SimCommand& chosen);
void addSkillCommand(CLI::App& app, SimCommand& chosen);
void addStabilityCommand(CLI::App& app, SimCommand& chosen);
void addEffectsCommand(CLI::App& app, SimCommand& chosen);

/// Prints `needlelab-sim COMMAND: MESSAGE` on stderr and returns the exit code.
int failed(const char* command, const Error& error);

/// Parses and runs a whole command line, as `main` does. Never throws; exit codes of common/base/program.h.
int runSim(int argc, const char* const* argv);

}  // namespace needlelab
