/// Whether a needle can come to a profile's targets, for authors of patients and exercises.
#pragma once

#include <string>
#include <vector>

#include "needlelab/profile.pb.h"

namespace needlelab {

/// One sentence for each target that a needle cannot come to, with its field: no part of its ball is in its
/// tissues, it lies outside the body or in bone, or it is deeper than the needle is long. The shortest way
/// counts, straight in above the target. `profile` came from `parseProfile`; `needle_length_m`: the profile's
/// or the exercise's own. May be empty.
std::vector<std::string> unreachableTargets(const pb::Profile& profile, double needle_length_m);

}  // namespace needlelab
