/// Rules across fields of a profile or exercise. `parseProfile` and similar functions check them.
#pragma once

#include <string>
#include <vector>

#include "common/base/result.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Errors: kInvalidInput, `PATH: words`, without a source; the first fault only.
Status checkProfileRules(const pb::Profile& profile);
/// What a profile lacks because of what else it has: without a volume a limb, layers, their thicknesses; the
/// shapes of targets and hazards that name no structure. Each fault begins with its path.
std::vector<Error> missingParts(const pb::Profile& profile);
Status checkExerciseRules(const pb::Exercise& exercise, const std::string& path);
Status checkCurriculumRules(const pb::Curriculum& curriculum);

}  // namespace needlelab
