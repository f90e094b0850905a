#include "client/station/run/say.h"

#include <unistd.h>

#include "common/base/text.h"

namespace needlelab {

LiveLine& liveLine() {
  static LiveLine line(STDERR_FILENO);
  return line;
}

void say(const std::string& text) {
  // words of the server, of a file or of an instructor may be among them: nothing that commands a terminal
  liveLine().say("station: " + printable(text));
}

}  // namespace needlelab
