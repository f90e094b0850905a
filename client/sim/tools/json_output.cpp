#include "client/sim/tools/json_output.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "common/base/files/files.h"
#include "common/base/program.h"

namespace needlelab {

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
  nlohmann::ordered_json whole = {{"version", NEEDLELAB_VERSION}, {"machine", machineText()}, {"rows", rows}};
  whole.update(more);
  const std::string text = whole.dump(2) + "\n";
  if (!option.file.empty()) return writeFileAtomically(option.file, viewOf(text));
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
    return Error{ErrorCode::kFailed, "cannot write to standard output"};
  return {};
}

}  // namespace needlelab
