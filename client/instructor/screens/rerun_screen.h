/// "What would it have felt like": the engine on the recording, with another profile or model.
#pragma once

#include <string>

#include "client/instructor/model/desk.h"

namespace needlelab {

/// Thread: the surface's.
class RerunScreen {
 public:
  void show(Desk& desk);
  std::string profile = "own", model;  ///< chosen; an empty model: the profile's

 private:
  void showChoice(Desk& desk);
  void showForces(Desk& desk);
};

}  // namespace needlelab
