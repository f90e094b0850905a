/// Patients in a late loop, as a station runs them: stiffness lowered to the delay, with the passivity
/// control.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "client/device/hand/hand_plan.h"
#include "client/sim/stability/loop/measures.h"
#include "client/sim/stability/loop/plant.h"
#include "common/haptics/gate/handle_stiffness.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"

namespace needlelab::late_goal {

inline constexpr const char* kPatients[] = {"shoulder-adult", "lumbar-adult", "volumes/shoulder-median",
                                            "volumes/lumbar-median"};

struct Patient {
  SceneSpec scene;
  Vec3 skin_W_m, out_W;  ///< above the first target
};
inline Patient patientOf(const std::string& name) {
  const auto profile = loadProfile(std::filesystem::path(NEEDLELAB_DB_SAMPLES) / (name + ".json"));
  EXPECT_TRUE(profile.ok());
  const auto scene = sceneSpecOf(*profile);
  EXPECT_TRUE(scene.ok());
  Patient patient{*scene, {}, {}};
  const auto& center = profile->targets(0).center_m();
  const Vec3 target_W_m{center.x(), center.y(), center.z()};
  patient.out_W = outwardNormal(patient.scene.limb, target_W_m);
  patient.skin_W_m = skinAbove(patient.scene.limb, target_W_m, patient.out_W);
  return patient;
}

struct LateRun {
  double share = 1;  ///< all that acts at once, K ≤ (b + 0.9)/(T (½ + D)), as here computed
  PlantRun run;
};
inline LateRun runOf(const Patient& patient, const HandPlan& plan, const PlantOptions& options,
                     bool lowered) {
  static const ForceSourceFactory engine = engineSource();
  LateRun out;
  SceneSpec scene = patient.scene;
  auto source = engine(scene, options.rate_hz);
  EXPECT_TRUE(source.ok());
  if (!source.ok()) return out;
  const double late_s = options.device.delay_ticks / options.rate_hz + options.device.lag_s;
  out.share = std::min(1.0, (options.device.limits.damping_Ns_per_m + 0.9) /
                                (0.5 / options.rate_hz + late_s) / (*source)->axialStiffness_N_per_m());
  if (lowered) {
    lowerStiffness(scene, {.delay = out.share});
    source = engine(scene, options.rate_hz);
    EXPECT_TRUE(source.ok());
  }
  auto run = runPlant(**source, plan, options);
  EXPECT_TRUE(run.ok());
  if (run.ok()) out.run = *std::move(run);
  EXPECT_TRUE(allFinite(out.run));
  return out;
}

}  // namespace needlelab::late_goal
