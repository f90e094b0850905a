/// Output of the station's checks (list of devices, self-test, calibration): text and JSON.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "client/station/run/io/options.h"
#include "common/base/result.h"

namespace needlelab {

/// Returns {"version", "machine", "rows": rows} and a newline.
std::string reportJson(const nlohmann::ordered_json& rows);

/// Prints the error to standard error; returns its exit code.
int refused(const Error& error);

/// Prints `text` to standard output. With --json, prints `json` there and `text` to standard error, or writes
/// `json` to its file (atomically). Returns `code`, or kExitFailed after a write error, which it reports on
/// standard error.
int printReport(const StationOptions& options, const std::string& text, const std::string& json, int code);

}  // namespace needlelab
