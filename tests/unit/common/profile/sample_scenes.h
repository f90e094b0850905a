/// The scenes of db/samples, for tests over all of them.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <string>

#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab::test {

/// By the file's name without extension, with or without the bodies in db/samples/volumes. A curriculum is no
/// scene; a profile that cannot be read fails the test.
inline std::map<std::string, SceneSpec> sampleScenes(bool with_bodies = false) {
  std::map<std::string, SceneSpec> scenes;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(NEEDLELAB_SAMPLES)) {
    const std::string name = entry.path().stem().string();
    const bool is_body = entry.path().parent_path().filename() == "volumes";
    if (entry.path().extension() != ".json" || name.find("curriculum") != std::string::npos) continue;
    if (is_body && !with_bodies) continue;
    const auto profile = loadProfile(entry.path());
    EXPECT_TRUE(profile.ok()) << name;
    if (!profile.ok()) continue;
    const auto scene = sceneSpecOf(*profile);
    EXPECT_TRUE(scene.ok()) << name;
    if (scene.ok()) scenes.emplace(name, *scene);
  }
  return scenes;
}

}  // namespace needlelab::test
