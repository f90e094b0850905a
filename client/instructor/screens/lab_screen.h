/// The whole lab: a tile for each station, those that need help first.
#pragma once

#include "client/instructor/model/desk.h"

namespace needlelab {

void showLab(Desk& desk);

}  // namespace needlelab
