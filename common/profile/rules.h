/// Rules over several fields of a profile or exercise. Private to this folder.
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

/// Returns the section with the effect's numbers; null if the profile or the effect has none.
const google::protobuf::Message* sectionOf(const EffectEntry& effect, const pb::Profile& profile);

}  // namespace needlelab
