/// Lists of aids (pb::Exercise::Aid): what a station shows the trainee, as an exercise allows it or as an
/// instructor changes it.
#pragma once

#include <google/protobuf/repeated_field.h>

#include <string>
#include <string_view>

#include "common/base/result.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// As Protobuf holds a repeated enum: numbers that this version may not know.
using AidList = google::protobuf::RepeatedField<int>;

/// kInvalidInput, `PATH[2]: words`: an aid that is none, or is listed twice. Empty lists are valid: no aids.
Status checkAids(const std::string& path, const AidList& aids);

/// All but ULTRASOUND, which takes time to draw: what holds where an exercise says nothing.
AidList usualAids();
/// What the exercise allows; the usual ones where it says nothing.
AidList aidsOfExercise(const pb::Exercise& exercise);
[[nodiscard]] bool hasAid(const AidList& aids, pb::Exercise::Aid aid);

/// "DEPTH, FORCE"; "none" for an empty list.
std::string aidsText(const AidList& aids);
/// The inverse, upper or lower case, spaces as one likes; "none": none, "all": all of them. kInvalidInput
/// names the word that is not an aid, and all aids.
Result<AidList> parseAids(std::string_view text);

}  // namespace needlelab
