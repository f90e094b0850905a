/// Whether a needle can reach a profile's targets, for authors of patients and exercises.
#pragma once

#include <string>
#include <vector>

#include "needlelab/profile.pb.h"

namespace needlelab {

/// Returns one sentence, with the field, for each target that a needle cannot reach: no part of its ball is
/// in its tissues, it lies outside the body or in bone, or it is deeper than the needle is long (measured
/// along the shortest path, straight in above the target). `profile` must be from `parseProfile`;
/// `needle_length_m`: the profile's or the exercise's. May be empty.
std::vector<std::string> unreachableTargets(const pb::Profile& profile, double needle_length_m);

}  // namespace needlelab
