/// The common JSON output of the subcommands.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "common/base/result.h"

namespace CLI {
class App;
}

namespace needlelab {

/// `--json [FILE]`: not given, given without a file (standard output), or a file.
struct JsonOption {
  bool wanted = false;
  std::string file;  ///< empty = standard output
};
/// `option` must outlive the parsing.
void addJsonOption(CLI::App& app, JsonOption& option);

/// Writes `{"version", "machine", "rows"}` to the option's target.
Status writeJson(const JsonOption& option, const nlohmann::ordered_json& rows);
/// The same with the keys of `more` (an object) behind "rows".
Status writeJson(const JsonOption& option, const nlohmann::ordered_json& rows,
                 const nlohmann::ordered_json& more);

}  // namespace needlelab
