#include "tests/unit/db/planted_here.h"

namespace needlelab {

// replaces the library's function
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
