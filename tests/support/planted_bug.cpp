// For a test's program: the bug that NEEDLELAB_PLANT names is in it. In the program's own sources, so that it
// stands before the library's (common/base/planted_bug.cpp).
#include "common/base/planted_bug.h"

#include <cstdlib>

namespace needlelab {

bool planted(PlantedBug bug) noexcept {
  static const char* const name = std::getenv("NEEDLELAB_PLANT");
  return name != nullptr && nameOf(bug) == name;
}

}  // namespace needlelab
