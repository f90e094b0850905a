/// The reference engine as a force source for the hard cases, with or without a planted defect.
#pragma once

#include "client/sim/stability/loop/plant.h"
#include "tests/support/reference/reference_engine.h"

namespace needlelab::test {

/// The enhanced tracking wall, whatever the scene's model.
ForceSourceFactory referenceSource(Defect planted = Defect::kNone);

}  // namespace needlelab::test
