/// Lists of aids (pb::Exercise::Aid) that a station shows the trainee, as set by the exercise or changed by
/// the instructor.
#pragma once

#include <google/protobuf/repeated_field.h>

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Protobuf's form of a repeated enum: may contain numbers unknown to this version.
using AidList = google::protobuf::RepeatedField<int>;

/// Errors: kInvalidInput, `PATH[2]: words`, for an unknown aid or an aid listed twice. An empty list is
/// valid: no aids.
Status checkAids(const std::string& path, const AidList& aids);

/// The default of an exercise: all aids but ULTRASOUND, which takes time to draw, and STEPS, which lead
/// through the whole exercise.
AidList usualAids();
/// Returns the aids that the exercise allows; the default aids if it lists none.
AidList aidsOfExercise(const pb::Exercise& exercise);
[[nodiscard]] bool hasAid(const AidList& aids, pb::Exercise::Aid aid);

/// "DEPTH, FORCE"; "none" for an empty list.
std::string aidsText(const AidList& aids);
/// The inverse of aidsText; case and spaces do not matter; "none" and "all" are accepted. Errors:
/// kInvalidInput, naming the word that is not an aid, and all aids.
Result<AidList> parseAids(std::string_view text);

}  // namespace needlelab
