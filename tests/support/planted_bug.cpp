// For test programs: enables the bug named by NEEDLELAB_PLANT. It is in the program's own sources, so that it
// overrides the library's version (common/base/planted_bug.cpp).
#include "common/base/planted_bug.h"

#include <cstdlib>

namespace needlelab {

bool planted(PlantedBug bug) noexcept {
  static const char* const name = std::getenv("NEEDLELAB_PLANT");
  return name != nullptr && nameOf(bug) == name;
}

}  // namespace needlelab
