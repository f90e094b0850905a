#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <nlohmann/json.hpp>
#include <string>

#include "client/sim/command.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/usage/usage.h"

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
    addAnatomyCommand(app, chosen);
    addStabilityCommand(app, chosen);
    addEffectsCommand(app, chosen);
    addStiffnessCommand(app, chosen);
    const std::string version = "needlelab-sim " + programVersion();
    app.set_version_flag("--version", version);
    for (CLI::App* command : app.get_subcommands({})) command->set_version_flag("--version", version);
    try {
      app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
      return afterOutput(endOfParsing(app, e, argc, argv), "needlelab-sim");
    }
    return afterOutput(chosen(), "needlelab-sim");
  } catch (const std::exception& e) {
    // out of memory or a file system error: report one line, never a trace
    std::fprintf(stderr, "needlelab-sim: %s\n", e.what());
    return kExitFailed;
  }
}

void addJsonOption(CLI::App& app, JsonOption& option) {
  app.add_option_function<std::string>(
         "--json",
         [&option](const std::string& file) {
           option.wanted = true;
           option.file = file;
         },
         "JSON instead of a table; to standard output without FILE")
      ->type_name("[FILE]")
      ->expected(0, 1)
      ->default_str("");
}

Status checkFolderOutputs(const std::vector<NamedFile>& inputs, const NamedFile& folder,
                          const std::vector<std::string>& names, const JsonOption& json) {
  std::vector<NamedFile> outputs;
  if (!folder.path.empty())
    for (const std::string& name : names) outputs.push_back({folder.option, folder.path / name});
  outputs.push_back({"--json", json.file});
  return checkOutputs(inputs, outputs);
}

Status writeJson(const JsonOption& option, const nlohmann::ordered_json& rows) {
  return writeJson(option, rows, nlohmann::ordered_json::object());
}

Status writeJson(const JsonOption& option, const nlohmann::ordered_json& rows,
                 const nlohmann::ordered_json& more) {
  nlohmann::ordered_json whole = {{"version", programVersion()}, {"machine", machineText()}, {"rows", rows}};
  whole.update(more);
  const std::string text = whole.dump(2) + "\n";
  if (!option.file.empty()) return writeFileAtomically(option.file, viewOf(text));
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
    return Error{ErrorCode::kFailed, "cannot write to standard output"};
  return {};
}

}  // namespace needlelab
