/// The station's terminal: messages, and Enter.
#pragma once

#include <string>

#include "client/station/run/io/live_line.h"

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

}  // namespace needlelab
