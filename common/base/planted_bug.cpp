// In a file of its own, so that a test program with its own definition never links this one from the library.
#include "common/base/planted_bug.h"

namespace needlelab {

bool planted(PlantedBug) noexcept {
  return false;
}

}  // namespace needlelab
