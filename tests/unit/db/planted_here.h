/// The bug that is planted in this program now, by a test.
#pragma once

#include <optional>

#include "common/base/planted_bug.h"

namespace needlelab::test {

std::optional<PlantedBug>& bugPlantedHere();

}  // namespace needlelab::test
