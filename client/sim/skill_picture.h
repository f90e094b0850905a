/// The study of skill as a picture.
#pragma once

#include <filesystem>

#include "base/result.h"
#include "skill/skill_study.h"

namespace needlelab {

/// Writes `folder`/skill.png; makes the folder. Errors: kFailed.
Status drawSkill(const SkillReport& report, const std::filesystem::path& folder);

}  // namespace needlelab
