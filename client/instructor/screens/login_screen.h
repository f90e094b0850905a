/// The first screen: server, its CA file, name, password; what is wrong in plain words.
#pragma once

#include "client/instructor/model/desk.h"

namespace needlelab {

void showLogin(Desk& desk);

}  // namespace needlelab
