/// What a profile or exercise must fulfil beyond single fields. Private to this folder.
#pragma once

#include "common/base/result.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Errors: kInvalidInput, `PATH: words`, without a source; the first fault only.
Status checkProfileRules(const pb::Profile& profile);
Status checkExerciseRules(const pb::Exercise& exercise, const std::string& path);
Status checkCurriculumRules(const pb::Curriculum& curriculum);

}  // namespace needlelab
