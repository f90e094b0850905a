/// The subcommands of needlelab-sim: each file in this folder named *_command.cpp adds one; their common JSON
/// output.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "common/base/files/files.h"
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
void addAnatomyCommand(CLI::App& app, SimCommand& chosen);
void addRunCommand(CLI::App& app, SimCommand& chosen);
void addFiguresCommand(CLI::App& app, SimCommand& chosen);
void addPrecomputeCommand(CLI::App& app, SimCommand& chosen);
void addScoreCommand(CLI::App& app, SimCommand& chosen);
void addStabilityCommand(CLI::App& app, SimCommand& chosen);
void addEffectsCommand(CLI::App& app, SimCommand& chosen);
void addStiffnessCommand(CLI::App& app, SimCommand& chosen);

/// Prints `needlelab-sim COMMAND: MESSAGE` on stderr and returns the exit code.
int failed(const char* command, const Error& error);

/// Parses and runs a whole command line, as `main` does. Never throws; exit codes of common/base/program.h.
int runSim(int argc, const char* const* argv);

/// `--json [FILE]`: absent, without a file (standard output), or with a file.
struct JsonOption {
  bool wanted = false;
  std::string file;  ///< empty = standard output
};
/// `option` must outlive the parsing.
void addJsonOption(CLI::App& app, JsonOption& option);

/// Like checkOutputs, for a command that writes files of these names into `folder` (with its option; an empty
/// path: none), which must exist, and JSON.
Status checkFolderOutputs(const std::vector<NamedFile>& inputs, const NamedFile& folder,
                          const std::vector<std::string>& names, const JsonOption& json);

/// Writes `{"version", "machine", "rows"}` to the option's target.
Status writeJson(const JsonOption& option, const nlohmann::ordered_json& rows);
/// The same with the keys of `more` (an object) after "rows".
Status writeJson(const JsonOption& option, const nlohmann::ordered_json& rows,
                 const nlohmann::ordered_json& more);

}  // namespace needlelab
