#include "tests/unit/db/planted_here.h"

namespace needlelab {

// in place of the library's
bool planted(PlantedBug bug) noexcept {
  return test::bugPlantedHere() == bug;
}

namespace test {

std::optional<PlantedBug>& bugPlantedHere() {
  static std::optional<PlantedBug> bug;
  return bug;
}

}  // namespace test
}  // namespace needlelab
