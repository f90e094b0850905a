/// Output of the station's checks (list of devices, self-test, calibration): text and JSON.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "client/station/run/options.h"
#include "common/base/result.h"

namespace needlelab {

/// Returns the terminal columns of a text: UTF-8 without combining or wide characters.
std::size_t columnsOf(std::string_view text);
/// Pads `text` with blanks to at least `columns`.
std::string padded(std::string_view text, std::size_t columns);
/// Breaks `text` at blanks into lines of at most `width`. Each line begins with `indent` blanks and ends with
/// a newline. A wider word gets its own line.
std::string wrapped(std::string_view text, std::size_t indent, std::size_t width = 100);

/// Returns {"version", "machine", "rows": rows} and a newline.
std::string reportJson(const nlohmann::ordered_json& rows);

/// Prints the error to standard error; returns its exit code.
int refused(const Error& error);

/// Prints `text` to standard output. With --json, prints `json` there and `text` to standard error, or writes
/// `json` to its file (atomically). Returns `code`, or kExitFailed after a write error, which it reports on
/// standard error.
int printReport(const StationOptions& options, const std::string& text, const std::string& json, int code);

}  // namespace needlelab
