/// The bug that a test has planted in this program.
#pragma once

#include <optional>

#include "common/base/planted_bug.h"

namespace needlelab::test {

std::optional<PlantedBug>& bugPlantedHere();

}  // namespace needlelab::test
