/// Scenes in a body for tests, with forces that tell tissues apart.
#pragma once

#include <memory>
#include <utility>

#include "common/anatomy/field_body.h"
#include "common/haptics/scene_spec.h"
#include "tests/support/anatomy/fields.h"

namespace needlelab::test {

inline constexpr double kRate_hz = 1000;

/// A needle that points down and leans towards +x.
inline Quat leaning(double angle_rad) {
  return {0, std::cos(angle_rad / 2), 0, std::sin(angle_rad / 2)};
}

/// Tissue of a cutting force; friction and lateral stiffness go with it.
inline LayerSpec tissue(double cutting_N, double friction_N_per_m = 10, double lateral_N_per_m2 = 4000) {
  LayerSpec layer;
  layer.thickness_m = 0.01;
  layer.cutting_force_N = cutting_N;
  layer.attracted_force_N = 0.4 * cutting_N;
  layer.rejection_force_N = 0.1 * cutting_N;
  layer.friction_N_per_m = friction_N_per_m;
  layer.lateral_stiffness_N_per_m2 = lateral_N_per_m2;
  return layer;
}
inline FieldStructure structure(std::string id, LayerSpec layer) {
  FieldStructure made;
  made.name = made.id = std::move(id);
  made.layer = std::move(layer);
  return made;
}
inline LayerSpec boneTissue() {
  LayerSpec layer = tissue(5);
  layer.is_bone = true;
  return layer;
}

inline constexpr EffectMask kEffectsInBody = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted) |
                                             bitOf(Effect::kClamping) | bitOf(Effect::kShaftFriction) |
                                             bitOf(Effect::kPuncture) | bitOf(Effect::kBone);

/// A scene in the field; every effect that the field's structures have numbers for is live.
inline SceneSpec sceneIn(const FieldSpec& field, const Pose& X_WL = {}) {
  SceneSpec spec;
  spec.needle_length_m = 0.06;
  spec.needle_diameter_m = 0.7e-3;
  spec.limb = BodyLimb{std::make_shared<FieldBody>(fieldOf(field)), X_WL};
  for (const FieldStructure& one : field.structures) {
    spec.layers.push_back(one.layer);
    spec.layers.back().thickness_m = 0.01;
  }
  spec.effects = kEffectsInBody;
  spec.stage_numbers[stageOf(Effect::kBone)][kBoneStiffness_N_per_m] = 600;
  spec.stage_numbers[stageOf(Effect::kBone)][kBoneFriction] = 0.3;
  return spec;
}

/// z > 0 is air; skin of 2 mm, fat to 8 mm, muscle.
inline FieldSpec slabOfTissue() {
  FieldSpec spec;
  spec.groups = {{"skin", {halfSpace({}, {0, 0, 1})}}};
  spec.structures = {structure("muscle", tissue(0.8, 20, 6000)), structure("dermis", tissue(2.0)),
                     structure("fat", tissue(0.4))};
  spec.structures[1].layer.membrane = MembraneSpec{800, 4e5, 1.5};
  spec.rules = {rule("skin", -2, 0, "dermis"), rule("skin", -8, -2, "fat")};
  spec.skin = "skin";
  spec.rest = "muscle";
  return spec;
}

/// The same as shells: the structures from the skin inwards.
inline SceneSpec slabAsShells(const SceneSpec& body) {
  SceneSpec spec = body;
  spec.limb = PlaneLimb{{0, 0, 0}, {0, 0, 1}};
  spec.layers = {body.layers[1], body.layers[2], body.layers[0]};
  spec.layers[0].thickness_m = 0.002;
  spec.layers[1].thickness_m = 0.006;
  spec.layers[2].thickness_m = 1;
  return spec;
}
inline constexpr int kSlabStructures[] = {1, 2, 0};  ///< the structure of each layer of slabAsShells

/// An arm of 40 mm radius along x, its top at z = 0: skin, muscle and a bone of 11 mm in its middle.
inline FieldSpec arm() {
  FieldSpec spec;
  spec.groups = {{"skin", {capsule(mm(-200, 0, -40), mm(200, 0, -40), 40, 40)}},
                 {"bone", {capsule(mm(-200, 0, -40), mm(200, 0, -40), 11, 11)}}};
  spec.structures = {structure("dermis", tissue(2.0)), structure("muscle", tissue(0.8, 20, 6000)),
                     structure("bone", boneTissue())};
  spec.rules = {rule("bone", -kNoBound, 0, "bone"), rule("skin", -2, 0, "dermis")};
  spec.skin = "skin";
  spec.rest = "muscle";
  return spec;
}

}  // namespace needlelab::test
