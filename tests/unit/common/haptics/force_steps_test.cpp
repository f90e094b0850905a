// Wherever a stage, a layer or a membrane begins or ends, the force changes by at most what its springs give
// at the needle's speed plus 0.05 N; a larger step is a release that the report names. A scan over edges of
// the bone, frictions, speeds, effects, models and limbs.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "common/haptics/effects/effect_entry.h"
#include "tests/support/scenes/model_scenes.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

constexpr double kRate_Hz = 1000, kEdge_N_per_m = 600, kMostStep_N = 0.05;
constexpr EffectMask kOnBone = bitOf(Effect::kBone), kMemory = bitOf(Effect::kCutMemory);
/// Each of these flags a release in this tick.
constexpr std::uint32_t kNamed = kFlagLayerChange | kFlagRupture | kFlagTurn;

/// The largest step beyond the springs' change, and where.
struct Step {
  double beyond_N = 0;
  std::string where;
};

/// The sum of the scene's springs. A bone gives √(2 + μ²) of its stiffness where friction follows the
/// pressure or the skin shortens its spring (FORCE_MODEL.md, "Bone"): up to 30 mm/s that is within the 0.05
/// N.
double springs_N_per_m(const SceneModel& model, double speed_mps) {
  double sum = 0;
  if (model.isLive(Effect::kCutting) || model.isLive(Effect::kAttracted))
    sum += model.axial_stiffness_N_per_m;
  if (model.isLive(Effect::kShaftFriction)) sum += model.friction_stiffness_N_per_m;
  if (model.isLive(Effect::kClamping)) sum += model.fixture.max_stiffness_N_per_m;
  if (model.isLive(Effect::kPuncture))
    for (std::uint32_t i = 0; i < model.membrane_count; ++i)
      sum += model.membranes[i].slope_at_rupture_N_per_m;
  if (model.isLive(Effect::kBone)) {
    const StageNumbers& bone = model.stage_numbers[stageOf(Effect::kBone)];
    sum += bone[0] * (speed_mps > 0.031 ? std::sqrt(2 + bone[1] * bone[1]) : 1.0);
  }
  return sum;
}

/// `forget_m` plants a fault: the force ends the first time the bone's spring has this length on the way
/// back.
Step greatestStep(const SceneSpec& scene, const Motion& motion, double forget_m = 0) {
  const auto model = std::make_unique<SceneModel>(compiled(scene, kRate_Hz));
  const auto state = std::make_unique<SimState>();
  double speed_mps = 0;
  for (std::size_t k = 1; k < motion.size(); ++k)
    speed_mps = std::max(speed_mps, norm(motion[k].p_WT_m - motion[k - 1].p_WT_m) * kRate_Hz);
  const double springs = springs_N_per_m(*model, speed_mps);
  Step most;
  StepReport report;
  Vec3 before_N, before_m = motion.front().p_WT_m;
  double bone_N = 0;
  bool forgotten = false;
  for (std::size_t k = 0; k < motion.size(); ++k) {
    step(*model, motion[k], *state, report);
    const Vec3 force_N = forgotten ? Vec3{} : report.wrench_W.force_N, tip_m = motion[k].p_WT_m;
    // the tissue releases a needle that leaves it; the bone has done so before
    const double change_N = (report.flags & kFlagExit) != 0 ? bone_N : norm(force_N - before_N);
    const double beyond_N = change_N - springs * norm(tip_m - before_m);
    if (beyond_N > most.beyond_N && (report.flags & kNamed) == 0)
      most = {beyond_N, fmt::format("tick {} at {:.5f} {:.5f} {:.5f}, depth {:.5f}", k, tip_m.x, tip_m.y,
                                    tip_m.z, report.depth_m)};
    const double now_N = report.stage_N[stageOf(Effect::kBone)];
    forgotten = forgotten || (now_N < bone_N && now_N < kEdge_N_per_m * forget_m);
    bone_N = now_N;
    before_N = force_N;
    before_m = tip_m;
  }
  return most;
}

/// 2 mm of skin and fat down to the bone, with a membrane on both.
SceneSpec overBone(double top_m, double friction, EffectMask effects) {
  SceneSpec scene = allEffects();
  const double fat_m = top_m - 0.002;
  scene.layers.resize(3);
  scene.layers[0].thickness_m = 0.002;
  scene.layers[0].membrane = MembraneSpec{200, 20'000, 0.6};
  scene.layers[1].thickness_m = fat_m;
  scene.layers[1].membrane = MembraneSpec{300, 0, 0.5};
  scene.layers[2].thickness_m = 0.03;
  scene.layers[2].membrane.reset();
  scene.layers[2].is_bone = true;
  scene.max_force_N = 50;
  scene.effects = effects | kOnBone;
  useUsualNumbers(effectEntry(Effect::kCutMemory), scene);
  scene.virtual_fixture.mode = ClampingMode::kConservative;
  effectEntry(Effect::kBone).fields[0].of(scene) = kEdge_N_per_m;
  effectEntry(Effect::kBone).fields[1].of(scene) = friction;
  return scene;
}

/// A place beside the site: how deep, and how far along the two lateral directions. In m.
struct Place {
  double depth_m, along_m, across_m = 0;
};

Motion through(const Site& site, Vec3 axis, double speed_mps, const std::vector<Place>& places) {
  const auto at = [&](const Place& place) {
    return site.p_surface_m + site.inward * place.depth_m + site.across_1 * place.along_m +
           site.across_2 * place.across_m;
  };
  MotionBuilder builder(kRate_Hz, at(places.front()), axis);
  for (const Place& place : places) builder.slideTo(at(place), speed_mps);
  return builder.take();
}

/// Across every edge of a bone that meets the skin `edge_m` beside the site and slopes down from there by
/// `slope`.
std::vector<Motion> overTheEdges(const Site& site, Vec3 axis, double speed_mps, double edge_m, double slope) {
  std::vector<Motion> motions;
  for (const double deep_m : {0.002, 0.006}) {
    const double foot_m = edge_m - 0.012, foot_depth_m = 0.012 * slope;
    const std::vector<std::vector<Place>> ways = {
        // up the slope and out of the skin, pressed by deep_m; and down again
        {{-0.003, foot_m}, {foot_depth_m + deep_m, foot_m}, {deep_m, edge_m}, {-0.001, edge_m + 0.004}},
        {{-0.003, foot_m}, {foot_depth_m + deep_m, foot_m}, {-0.004, edge_m + 0.01}},
        {{-0.001, edge_m + 0.004},
         {deep_m, edge_m + 0.004},
         {deep_m, edge_m - 0.02},
         {-0.002, edge_m - 0.02}},
        {{-0.001, edge_m + 0.004},
         {deep_m, edge_m + 0.004},
         {foot_depth_m + deep_m, foot_m},
         {-0.002, foot_m}},
        // straight up beside the edge, where the spring is stretched most
        {{-0.003, foot_m}, {foot_depth_m, foot_m}, {deep_m, edge_m + 0.003}, {-0.001, edge_m + 0.003}},
        {{-0.003, foot_m}, {foot_depth_m, foot_m}, {deep_m, edge_m - 0.001, 0.004}, {-0.001, edge_m, 0.004}},
        // repeatedly around the edge
        {{-0.001, edge_m - 0.003},
         {deep_m, edge_m - 0.003},
         {deep_m, edge_m + 0.003},
         {0.0002, edge_m + 0.003},
         {0.0002, edge_m - 0.003},
         {deep_m, edge_m + 0.002, 0.003},
         {0.5 * deep_m, edge_m - 0.002, 0.003},
         {deep_m, edge_m + 0.002, -0.003},
         {-0.001, edge_m, -0.003}},
        // in, a stop, and out
        {{-0.001, edge_m - 0.004}, {deep_m, edge_m - 0.002}, {-0.001, edge_m - 0.004}},
    };
    for (const auto& way : ways) motions.push_back(through(site, axis, speed_mps, way));
  }
  return motions;
}

/// The scene rendered by that model; its table rises straight from the skin to the depth, because a step in a
/// table is the author's.
SceneSpec modelled(const SceneSpec& scene, AxialModel model) {
  SceneSpec other = renderedBy(scene, model);
  other.statistical.table = {{0, 0.2, 0.05}, {0.02, 1.5, 0.3}};
  other.precomputed.table = {{0, 0.2, 0.1}, {0.02, 1.5, 0.3}};
  return other;
}

constexpr EffectMask kShaft = bitOf(Effect::kShaftFriction), kMembranes = bitOf(Effect::kPuncture),
                     kAside = bitOf(Effect::kClamping);

TEST(ForceSteps, onABoneThatSlantsToTheSkin) {
  const Site site = defaultSite();
  int runs = 0;
  const auto scan = [&](AxialModel model, EffectMask effects, double degrees, double friction,
                        double speed_mps, double tilt) {
    const double slope = std::tan(degrees * kDegree);
    SceneSpec scene = modelled(overBone(0.004, friction, effects), model);
    scene.bone_normal = -site.inward - site.across_1 * slope;
    const Vec3 axis = site.inward * std::cos(tilt * kDegree) + site.across_1 * std::sin(tilt * kDegree);
    int way = 0;
    for (const Motion& motion : overTheEdges(site, axis, speed_mps, 0.004 / std::max(slope, 0.4), slope)) {
      const Step most = greatestStep(scene, motion);
      EXPECT_LE(most.beyond_N, kMostStep_N)
          << axialModelName(model) << " effects " << effects << ", " << degrees << " degrees, friction "
          << friction << ", " << speed_mps << " m/s, way " << way << ", " << most.where;
      ++way;
      ++runs;
    }
  };
  for (const double degrees : {0.0, 25.0, 45.0, 60.0})
    for (const double friction : {0.0, 0.3, 1.0, 2.0}) {
      for (const double speed_mps : {0.01, 0.03, 0.1})
        scan(AxialModel::kEnhancedTrackingWall, 0, degrees, friction, speed_mps, 0);
      for (const EffectMask effects :
           {kAxial, kAxial | kMembranes | kShaft, kAxial | kAside, kPlacedEffects | kMemory})
        scan(AxialModel::kEnhancedTrackingWall, effects, degrees, friction, 0.03, friction > 0.5 ? 30 : 0);
    }
  for (const AxialModel model :
       {AxialModel::kTrackingWall, AxialModel::kStatistical, AxialModel::kPrecomputed})
    for (const double degrees : {25.0, 60.0})
      for (const EffectMask effects : {kAxial, kPlacedEffects | kMemory})
        scan(model, effects, degrees, 0.3, 0.03, 30);
  EXPECT_GT(runs, 1500);
}

// a finger of 12 mm radius, 8 mm of it bone. Pressed on, around, through the centre and out on the far side
TEST(ForceSteps, onARoundBone) {
  const std::vector<std::vector<Place>> ways = {
      {{-0.002, 0}, {0.009, 0}, {0.009, 0.006}, {-0.002, 0.012}},
      {{-0.002, 0.003}, {0.011, 0.003}, {0.011, -0.004, 0.003}, {-0.002, 0}},
      {{-0.002, 0.002}, {0.026, 0.002}},
      {{-0.002, 0.006, 0.001}, {0.026, 0.005}},
      {{-0.002, 0}, {0.010, 0.001}, {0.010, 0.014}, {0.002, 0.014}},
      {{0.008, -0.013}, {0.008, 0.013}},
      {{-0.002, 0}, {0.006, 0}, {0.006, 0.001}, {0.003, 0.001}, {0.006, 0.002}, {-0.002, 0.002}},
  };
  const Site site = defaultSite();
  for (const bool is_ball : {true, false})
    for (const EffectMask effects : {EffectMask{0}, kAxial, kPlacedEffects | kMemory})
      for (const double friction : {0.0, 0.3, 1.0, 2.0})
        for (const double speed_mps : {0.03, 0.1}) {
          SceneSpec scene = overBone(0.004, friction, effects);
          if (is_ball)
            scene.limb = SphereLimb{{0, 0, -0.012}, 0.012};
          else
            scene.limb = CapsuleLimb{{-0.02, -0.04, -0.012}, {0.02, 0.04, -0.012}, 0.012};
          for (const auto& way : ways) {
            const Step most = greatestStep(scene, through(site, site.inward, speed_mps, way));
            EXPECT_LE(most.beyond_N, kMostStep_N)
                << (is_ball ? "ball" : "capsule") << " effects " << effects << ", friction " << friction
                << ", " << speed_mps << " m/s, way " << &way - ways.data() << ", " << most.where;
          }
        }
}

// a contact that is dropped while its spring is stretched by 0.2 mm
TEST(ForceSteps, aPlantedStepIsFound) {
  const Site site = defaultSite();
  SceneSpec scene = overBone(0.004, 0.3, 0);
  scene.bone_normal = -site.inward - site.across_1;
  const Motion motion = overTheEdges(site, site.inward, 0.03, 0.004, 1).front();
  EXPECT_LE(greatestStep(scene, motion).beyond_N, kMostStep_N);
  EXPECT_GT(greatestStep(scene, motion, 2e-4).beyond_N, 600 * 2e-4 - 0.02);
}

}  // namespace
}  // namespace needlelab::test
