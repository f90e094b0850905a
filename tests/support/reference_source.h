/// The reference engine as a force source of the hard cases, with a planted defect or none.
#pragma once

#include "client/sim/stability/plant.h"
#include "tests/support/reference_engine.h"

namespace needlelab::test {

/// The enhanced tracking wall whatever the scene's model.
ForceSourceFactory referenceSource(Defect planted = Defect::kNone);

}  // namespace needlelab::test
