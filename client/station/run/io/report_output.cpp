#include "client/station/run/io/report_output.h"

#include <iostream>
#include <nlohmann/json.hpp>

#include "common/base/files/files.h"
#include "common/base/program.h"

namespace needlelab {

std::string reportJson(const nlohmann::ordered_json& rows) {
  const nlohmann::ordered_json report = {
      {"version", NEEDLELAB_VERSION}, {"machine", machineText()}, {"rows", rows}};
  // device text that is not UTF-8 must not end the program
  return report.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

int refused(const Error& error) {
  std::cerr << "needlelab-station: " << error.message << "\n";
  return exitCodeOf(error);
}

int printReport(const StationOptions& options, const std::string& text, const std::string& json, int code) {
  const bool json_on_stdout = options.json && options.json_file.empty();
  (json_on_stdout ? std::cerr : std::cout) << text << std::flush;
  if (json_on_stdout) std::cout << json << std::flush;
  if (!std::cout) {
    std::cerr << "needlelab-station: cannot write to standard output\n";
    return kExitFailed;
  }
  if (options.json && !json_on_stdout)
    if (const Status status = writeFileAtomically(options.json_file, viewOf(json)); !status.ok()) {
      std::cerr << "needlelab-station: " << status.error().message << "\n";
      return kExitFailed;
    }
  return code;
}

}  // namespace needlelab
