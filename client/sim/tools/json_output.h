/// The common JSON output of the subcommands.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "common/base/files/files.h"
#include "common/base/result.h"

namespace CLI {
class App;
}

namespace needlelab {

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
