/// The station's terminal: messages, Enter, and the output of checks.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "client/station/run/io/live_line.h"
#include "client/station/run/io/options.h"
#include "common/base/result.h"

namespace needlelab {

/// Prints one line to standard error, "station: …". Thread: any but the haptic one; lines never interleave.
void logMessage(const std::string& text);

/// Returns the live line, which stands below all messages.
LiveLine& liveLine();

/// Reads a terminal or a pipe without blocking. Thread: one, not the haptic one.
class EnterKey {
 public:
  /// Reads from `descriptor` and leaves it open.
  explicit EnterKey(int descriptor) : descriptor_(descriptor) {}
  /// Returns whether Enter was pressed (a line ended) since the last call. Does not read while another
  /// program is in the terminal's foreground, because that would suspend this one.
  bool pressed();
  /// Returns whether a person can answer, because it is a terminal.
  [[nodiscard]] bool isTerminal() const;

 private:
  int descriptor_;
  bool closed_ = false;
};

// --- output of the checks (list of devices, self-test, calibration): text and JSON

/// Returns {"version", "machine", "rows": rows} and a newline.
std::string reportJson(const nlohmann::ordered_json& rows);

/// Prints the error to standard error; returns its exit code.
int refused(const Error& error);

/// Prints `text` to standard output. With --json, prints `json` there and `text` to standard error, or writes
/// `json` to its file (atomically). Returns `code`, or kExitFailed after a write error, which it reports on
/// standard error.
int printReport(const StationOptions& options, const std::string& text, const std::string& json, int code);

}  // namespace needlelab
