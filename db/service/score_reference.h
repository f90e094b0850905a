/// An exercise's reference: what its experts' sessions come to, and how a score stands beside it. Private to
/// this folder.
#pragma once

#include <string>

#include "common/base/result.h"
#include "db/connection.h"
#include "db/service/reference_paths.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// The distance from the reference gestures (dtw_distance_m) is that of now in both: of each reference from
/// the nearest of the others, and of the session from the nearest of them all, whatever was the reference
/// when it was scored.

/// Fills bands and definition_version from the newest scores of the reference's sessions. Only scores of one
/// version are taken together: the newest that there is.
Status addBands(Connection& reader, ReferencePaths& paths, pb::Reference& reference);

/// As JSON (scoring/reference.h); empty when the exercise has no reference of the score's version.
Result<std::string> comparisonWith(Connection& reader, ReferencePaths& paths, const std::string& exercise_id,
                                   const pb::Score& score);

}  // namespace needlelab
