/// A profile's needle as numbers.
#pragma once

#include "common/base/result.h"
#include "common/haptics/needle_spec.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// `outer_diameter_m` as given, else the gauge's; 0 where neither is.
NeedleSpec needleOf(const pb::Needle& needle);

/// What the fields' own ranges cannot say: gauge and diameter that contradict each other, a bevel longer than
/// the needle. Errors: kInvalidInput with path and numbers.
Status checkNeedle(const pb::Needle& needle);

}  // namespace needlelab
