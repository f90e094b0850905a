/// What the station tells the person before it.
#pragma once

#include <string>

#include "client/station/run/live_line.h"

namespace needlelab {

/// One line on standard error, "station: …". Thread: any but the haptic one; lines never mix.
void say(const std::string& text);

/// The line below all that is said.
LiveLine& liveLine();

}  // namespace needlelab
