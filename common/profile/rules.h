/// What a profile or exercise must fulfil beyond single fields. Private to this folder.
#pragma once

#include "common/base/result.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

struct EffectEntry;

/// Errors: kInvalidInput, `PATH: words`, without a source; the first fault only.
Status checkProfileRules(const pb::Profile& profile);
Status checkExerciseRules(const pb::Exercise& exercise, const std::string& path);
Status checkCurriculumRules(const pb::Curriculum& curriculum);

/// Checks that the chosen model has its section, and that `synthetic` names parameters that exist.
Status checkModelSection(const pb::Profile& profile);

/// The section with the effect's numbers; null where the profile, or the effect, has none.
const google::protobuf::Message* sectionOf(const EffectEntry& effect, const pb::Profile& profile);

}  // namespace needlelab
