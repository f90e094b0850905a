/// The profiles of db/samples, inside the program: what a self-test steps.
#pragma once

#include <span>

#include "common/base/program.h"

namespace needlelab {

std::span<const EmbeddedFile> sampleProfiles();

}  // namespace needlelab
