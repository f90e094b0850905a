/// Stored sessions: search, choose, load.
#pragma once

#include <string>

#include "client/instructor/model/desk.h"

namespace needlelab {

/// Thread: the surface's.
class SessionsScreen {
 public:
  void show(Desk& desk);
  SessionQuery query;  ///< as typed

 private:
  void showFilter(Desk& desk);
  void showTable(Desk& desk);
};

}  // namespace needlelab
