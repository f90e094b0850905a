/// The same body twice: a ball of skin with layers, and a volume whose rules are shells of that ball.
#pragma once

#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "common/haptics/geometry.h"
#include "common/profile/profile.h"

namespace needlelab::test {

/// Both have a ball of 50 mm radius with its top at the origin of L; skin, fat and muscle end 3, 9 and 29 mm
/// deep (below, the volume's muscle goes on, as the last layer does). A target 15 mm deep, 4 mm off the
/// middle; a nerve across.
inline constexpr double kBallRadius_m = 0.05, kSkinEnd_m = 0.003, kFatEnd_m = 0.009;
inline constexpr const char* kBallNames[] = {"skin", "fat", "muscle"};

inline nlohmann::json ballCommon() {
  return nlohmann::json::parse(R"({
    "id": "ball", "name": "A ball", "axial_model": "ENHANCED_TRACKING_WALL",
    "needle": {"length_m": 0.06, "outer_diameter_m": 0.0008},
    "tracking_wall": {"stiffness_n_per_m": 500, "stop_speed_m_s": 0.003, "stop_dwell_s": 0.05,
                      "stop_duration_s": 0.8},
    "effects": ["CUTTING", "ATTRACTED"],
    "targets": [{"name": "target", "center_m": {"x": 0.004, "y": 0, "z": -0.015}, "radius_m": 0.003}],
    "hazards": [{"name": "nerve", "kind": "NERVE", "a_m": {"x": -0.01, "y": 0.004, "z": -0.012},
                 "b_m": {"x": 0.01, "y": 0.004, "z": -0.012}, "radius_m": 0.002}],
    "directions": {"plus_x": "down the arm", "minus_x": "up the arm", "plus_y": "towards the head",
                   "minus_y": "towards the foot"}
  })");
}

inline nlohmann::json ballLayer(const std::string& tissue, double cutting_N) {
  return {{"tissue", tissue},
          {"cutting_force_n", cutting_N},
          {"attracted_force_n", 0.5 * cutting_N},
          {"lateral_stiffness_n_per_m2", 5000},
          {"friction_n_per_m", 20}};
}

inline nlohmann::json ballOfLayers() {
  nlohmann::json tree = ballCommon();
  tree["limb"] =
      nlohmann::json::parse(R"({"sphere": {"center_m": {"x": 0, "y": 0, "z": -0.05}, "radius_m": 0.05}})");
  const double thickness_m[] = {0.003, 0.006, 0.02}, cutting_N[] = {0.8, 0.4, 0.6};
  const char* const tissues[] = {"SKIN", "FAT", "MUSCLE"};
  for (std::size_t i = 0; i < 3; ++i) {
    tree["layers"].push_back(ballLayer(tissues[i], cutting_N[i]));
    tree["layers"].back()["thickness_m"] = thickness_m[i];
  }
  return tree;
}

inline nlohmann::json ballOfRules() {
  nlohmann::json tree = ballCommon();
  tree["volume"] = nlohmann::json::parse(R"({
    "groups": [{"id": "ball", "parts": [{"capsule": {"a_m": {"x": 0, "y": 0, "z": -0.05},
                "b_m": {"x": 0, "y": 0, "z": -0.05}, "radius_a_m": 0.05}}]}],
    "structures": [],
    "rules": [{"group": "ball", "from_m": -0.003, "to_m": 0, "structure": "skin"},
              {"group": "ball", "from_m": -0.009, "to_m": -0.003, "structure": "fat"}],
    "skin": "ball", "rest": "muscle"})");
  const double cutting_N[] = {0.8, 0.4, 0.6};
  const char* const tissues[] = {"SKIN", "FAT", "MUSCLE"};
  for (std::size_t i = 0; i < 3; ++i)
    tree["volume"]["structures"].push_back(
        {{"id", kBallNames[i]}, {"layer", ballLayer(tissues[i], cutting_N[i])}});
  return tree;
}

/// The centre and radius of the cyst of `withCyst`.
inline constexpr Vec3 kCyst_m{0.002, -0.003, -0.02};
inline constexpr double kCystRadius_m = 0.004;

/// A volume with one more structure, a ball in the muscle: "cyst", which is the target and the hazard.
inline nlohmann::json withCyst() {
  nlohmann::json tree = ballOfRules();
  tree["volume"]["groups"].push_back(nlohmann::json::parse(
      R"({"id": "cyst", "parts": [{"capsule": {"a_m": {"x": 0.002, "y": -0.003, "z": -0.02},
          "b_m": {"x": 0.002, "y": -0.003, "z": -0.02}, "radius_a_m": 0.004}}]})"));
  tree["volume"]["structures"].push_back({{"id", "cyst"}, {"layer", ballLayer("OTHER", 0.3)}});
  auto& rules = tree["volume"]["rules"];
  rules.insert(rules.begin(), nlohmann::json{{"group", "cyst"}, {"to_m", 0}, {"structure", "cyst"}});
  tree["targets"] = nlohmann::json::parse(R"([{"name": "the cyst", "structure": "cyst"}])");
  tree["hazards"] = nlohmann::json::parse(R"([{"name": "the cyst", "kind": "VESSEL", "structure": "cyst"}])");
  return tree;
}

inline pb::Profile readProfile(const nlohmann::json& tree) {
  auto profile = parseProfile(tree.dump(), "profile");
  if (!profile.ok()) throw std::runtime_error(profile.error().message);
  return *std::move(profile);
}

}  // namespace needlelab::test
