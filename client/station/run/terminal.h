/// The terminal in front of the person: messages, and Enter.
#pragma once

#include <string>

#include "client/station/run/live_line.h"

namespace needlelab {

/// One line on standard error, "station: …". Thread: any but the haptic one; lines never mix.
void logMessage(const std::string& text);

/// The line below all messages.
LiveLine& liveLine();

/// Listens to a terminal or a pipe, and never waits for it. Thread: one, not the haptic one.
class EnterKey {
 public:
  /// `descriptor` is read from, and stays open.
  explicit EnterKey(int descriptor) : descriptor_(descriptor) {}
  /// Whether Enter was pressed (a line was ended) since the last call. Nothing is read from a terminal that
  /// belongs to another program at the moment, as that would stop this one.
  bool pressed();
  /// It is a terminal, so that there is somebody to wait for.
  [[nodiscard]] bool isTerminal() const;

 private:
  int descriptor_;
  bool closed_ = false;
};

}  // namespace needlelab
