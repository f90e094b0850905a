/// The study of skill as a picture.
#pragma once

#include <filesystem>

#include "client/sim/skill/skill_study.h"
#include "common/base/result.h"

namespace needlelab {

/// Writes `folder`/skill.png; makes the folder. Errors: kFailed.
Status drawSkill(const SkillReport& report, const std::filesystem::path& folder);

}  // namespace needlelab
