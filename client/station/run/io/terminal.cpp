#include "client/station/run/io/terminal.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "common/base/text/text.h"

namespace needlelab {

LiveLine& liveLine() {
  // never destroyed, because threads still log while the program ends
  static LiveLine& line = *new LiveLine(STDERR_FILENO);
  return line;
}

void logMessage(const std::string& text) {
  // may contain text from the server, a file or an instructor: removes terminal control characters
  liveLine().printMessage("station: " + printable(text));
}

bool EnterKey::isTerminal() const {
  return ::isatty(descriptor_) == 1;
}

bool EnterKey::pressed() {
  bool pressed = false;
  // a bounded number of reads, because input may come from a file
  for (int reads = 0; !closed_ && reads < 16; ++reads) {
    if (isTerminal() && ::tcgetpgrp(descriptor_) != ::getpgrp()) break;
    pollfd ready{descriptor_, POLLIN, 0};
    if (::poll(&ready, 1, 0) <= 0 || (ready.revents & (POLLIN | POLLHUP)) == 0) {
      closed_ = closed_ || (ready.revents & (POLLNVAL | POLLERR)) != 0;
      break;
    }
    std::array<char, 256> text;
    const ssize_t count = ::read(descriptor_, text.data(), text.size());
    if (count <= 0) {
      closed_ = true;
      break;
    }
    pressed = pressed || std::find(text.data(), text.data() + count, '\n') != text.data() + count;
  }
  return pressed;
}

}  // namespace needlelab
