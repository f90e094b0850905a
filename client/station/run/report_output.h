/// Output of the station's checks (list of devices, self-test, calibration): text and JSON.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "client/station/run/options.h"

namespace needlelab {

/// Columns that a text takes in a terminal: UTF-8 without combining or wide characters.
std::size_t columnsOf(std::string_view text);
/// `text` and blanks, `columns` wide at least.
std::string padded(std::string_view text, std::size_t columns);
/// Breaks `text` at blanks so that no line is wider than `width`; every line begins with `indent` blanks and
/// ends with a newline. A word wider than that stands alone.
std::string wrapped(std::string_view text, std::size_t indent, std::size_t width = 100);

/// {"version", "machine", "rows": rows} and a newline.
std::string reportJson(const nlohmann::ordered_json& rows);

/// Prints `text` to standard output; with --json, `json` goes there and `text` to standard error, or `json`
/// into its file (atomically). `code`, or kExitFailed when something could not be written, which is reported
/// on standard error.
int printReport(const StationOptions& options, const std::string& text, const std::string& json, int code);

}  // namespace needlelab
