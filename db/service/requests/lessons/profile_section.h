/// A profile's volume as a drawing for the console.
#pragma once

#include "common/base/result.h"
#include "needlelab/profile.pb.h"
#include "needlelab/teaching.pb.h"

namespace needlelab::handlers {

/// Cuts the volume along the skin's normal at the origin of L, or above the first target where no skin is
/// there: towards the first target if that lies aside, otherwise along L's y. Takes some 10 ms. Errors: those
/// of fieldOf.
Status addSection(const pb::Profile& profile, pb::ProfileSection& section);

}  // namespace needlelab::handlers
