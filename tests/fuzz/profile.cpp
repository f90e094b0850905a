// Fuzzes profiles and curricula: JSON written by people.
#include <array>
#include <cstring>

#include "common/haptics/scene_model.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/warnings.h"
#include "tests/fuzz/target.h"

namespace needlelab::fuzz {

void profile(ByteView data) {
  const auto parsed = parseProfile(textOf(data), "fuzz.json");
  if (!parsed.ok()) {
    require(!parsed.error().message.empty(), "a refusal says why");
    return;
  }
  if (kPlanted) {
    // The planted fault: a fixed-size buffer for a text.
    std::array<char, 48> name{};
    const auto take = [&](const std::string& text) { std::memcpy(name.data(), text.data(), text.size()); };
    for (const auto& target : parsed->targets()) take(target.name());
    for (const auto& hazard : parsed->hazards()) take(hazard.name());
    require(name.data()[0] != '\n', "names");
  }
  const std::string canonical = profileJson(*parsed);
  const auto again = parseProfile(canonical, "canonical.json");
  require(again.ok(), "canonical JSON parses");
  require(profileJson(*again) == canonical, "canonical JSON is canonical");
  (void)profileWarnings(*parsed);
  const auto spec = sceneSpecOf(*parsed);
  require(spec.ok(), "a valid profile is a scene");
}

void curriculum(ByteView data) {
  if (const auto exercise = parseExercise(textOf(data), "fuzz.json"); exercise.ok()) {
    const std::string canonical = exerciseJson(*exercise);
    const auto again = parseExercise(canonical, "canonical.json");
    require(again.ok() && exerciseJson(*again) == canonical, "an exercise's canonical JSON is canonical");
  }
  const auto parsed = parseCurriculum(textOf(data), "fuzz.json");
  if (!parsed.ok()) return;
  if (kPlanted) {
    // The planted fault: a fixed-size buffer for a text.
    std::array<char, 24> id{};
    for (const auto& exercise : parsed->exercises())
      std::memcpy(id.data(), exercise.id().data(), exercise.id().size());
    require(id.data()[0] != '\n', "ids");
  }
  const std::string canonical = curriculumJson(*parsed);
  const auto again = parseCurriculum(canonical, "canonical.json");
  require(again.ok() && curriculumJson(*again) == canonical, "a curriculum's canonical JSON is canonical");
}

}  // namespace needlelab::fuzz
