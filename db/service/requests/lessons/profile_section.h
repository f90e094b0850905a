/// A profile's volume as a drawing for the console.
#pragma once

#include <optional>

#include "common/base/result.h"
#include "common/haptics/geometry.h"
#include "needlelab/profile.pb.h"
#include "needlelab/teaching.pb.h"

namespace needlelab::handlers {

/// A needle that has just come through the skin, in L.
struct NeedleEntry {
  Vec3 tip_m;
  Vec3 axis;  ///< unit, from hub to tip
};

/// Cuts the volume along the skin's normal at the needle's entry; without one at the origin of L, or above
/// the first target where no skin is there. The cut holds the needle's axis if a needle of the profile's
/// length leans aside along it by 3 mm or more; otherwise it goes towards the first target if that lies
/// aside, or along L's y. Takes some 10 ms. Errors: those of fieldOf.
Status addSection(const pb::Profile& profile, pb::ProfileSection& section,
                  const std::optional<NeedleEntry>& needle = std::nullopt);

}  // namespace needlelab::handlers
