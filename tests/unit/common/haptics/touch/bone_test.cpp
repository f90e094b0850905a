// BONE (FORCE_MODEL.md, "Bone") by formula: no needle enters it, it sticks and slips by Coulomb's cone, the
// tissue's springs do not add to it, and it gives the hand no energy.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/models/like_for_like.h"
#include "common/haptics/surface.h"
#include "tests/support/realtime/no_alloc.h"
#include "tests/support/scenes/model_scenes.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

constexpr EffectMask kBoneBit = bitOf(Effect::kBone);
constexpr std::size_t kBoneTerm = stageOf(Effect::kBone);
constexpr double kBone_N_per_m = 1000, kRubs = 0.3, kTop_m = 0.010;

SceneSpec withBone(SceneSpec scene, EffectMask effects, double stiffness_N_per_m = kBone_N_per_m,
                   double friction = kRubs) {
  scene.effects = effects | kBoneBit;
  scene.max_force_N = 50;
  const EffectEntry& bone = effectEntry(Effect::kBone);
  bone.fields[0].of(scene) = stiffness_N_per_m;
  bone.fields[1].of(scene) = friction;
  return scene;
}

/// 10 mm of tissue with 1 N cutting force, on bone with 4 N.
SceneSpec onBone(EffectMask effects = kAxial, double friction = kRubs) {
  SceneSpec scene = oneLayer(1.0, 0.4, 0.1);
  scene.layers[0].thickness_m = kTop_m;
  scene.layers.push_back(scene.layers[0]);
  scene.layers[1].thickness_m = 0.030;
  scene.layers[1].cutting_force_N = 4.0;
  scene.layers[1].is_bone = true;
  return withBone(scene, effects, kBone_N_per_m, friction);
}

/// The six layers with all effects; the last one, below 26 mm, is bone.
SceneSpec sixLayersOnBone(LimbKind limb, double friction = kRubs) {
  SceneSpec scene = withClamping(withLimb(allEffects(), limb), ClampingMode::kConservative);
  scene.layers.back().is_bone = true;
  return withBone(scene, kPlacedEffects, 600, friction);
}

TEST(Bone, holdsTheNeedleByItsSpringAndCapsTheTissueForce) {
  for (const int ticks : {2000, 40, 8}) {  // 16 mm/s to 4 m/s
    Probe probe(onBone(), 1000);
    probe.at(-0.001);
    for (const StepReport& report : probe.go(ticks, 0.031)) ASSERT_LE(-report.cutting_N, 1.0 + 1e-9);
    const double deep_m = 0.031 - kTop_m;
    EXPECT_NEAR(probe.last().stage_N[kBoneTerm], kBone_N_per_m * deep_m, 1e-9) << ticks;
    EXPECT_NEAR(probe.last().wrench_W.force_N.z, kBone_N_per_m * deep_m - probe.last().cutting_N, 1e-9);
    EXPECT_NEAR(probe.state().bone.p_proxy_W_m.z, -kTop_m, 1e-12);
    EXPECT_EQ(probe.last().layer, 1) << "measures count contacts with bone by the layer";
  }
}

// too fast for a stop: in along 500 N/m up to 1 N, on the bone with 1000 N/m more, and back the same way
// until the tissue's spring is empty; then the attracted force
TEST(Bone, forceByDepthOnTheWayInAndOut) {
  Probe probe(onBone(), 1000);
  probe.at(0);
  for (int i = 1; i <= 75; ++i) {
    const double depth_m = 2e-4 * i;
    const double expected_N = std::min(500 * depth_m, 1.0) + kBone_N_per_m * std::max(0.0, depth_m - kTop_m);
    ASSERT_NEAR(probe.at(depth_m).wrench_W.force_N.z, expected_N, 1e-9) << depth_m;
  }
  for (int i = 74; i >= 1; --i) {
    const double depth_m = 2e-4 * i, in_tissue_m = std::min(depth_m, kTop_m);
    const double pull_N = std::min(0.4, 500 * depth_m);
    const double expected_N =
        std::max(500 * (in_tissue_m - 0.008), -pull_N) + kBone_N_per_m * std::max(0.0, depth_m - kTop_m);
    ASSERT_NEAR(probe.at(depth_m).wrench_W.force_N.z, expected_N, 1e-9) << depth_m;
  }
  EXPECT_FALSE(probe.state().bone.touching);
}

TEST(Bone, withoutItTheNeedleCutsTheBone) {
  Probe probe(withEffects(onBone(), kAxial), 1000);
  probe.at(-0.001);
  probe.go(2000, 0.035);
  EXPECT_NEAR(probe.last().wrench_W.force_N.z, 4.0, 1e-9) << "4 N, as deep as one likes";
}

TEST(Bone, holdsUnderEveryModel) {
  for (const AxialModel model : kAllModels) {
    if (model == AxialModel::kFem) continue;  // needs a mesh; the stage is the same
    Probe probe(likeForLike(onBone(), model), 1000);
    probe.at(-0.001);
    probe.go(60, 0.025);
    probe.stay(3000);
    EXPECT_NEAR(probe.last().stage_N[kBoneTerm], kBone_N_per_m * 0.015, 1e-9) << axialModelName(model);
    EXPECT_NEAR(probe.state().bone.p_proxy_W_m.z, -kTop_m, 1e-12) << axialModelName(model);
    probe.go(60, -0.001);
    EXPECT_EQ(probe.last().wrench_W.force_N, Vec3{}) << axialModelName(model);
  }
}

TEST(Bone, sticksWithinTheConeOfFrictionAndSlipsAtItsEdge) {
  for (const double slope : {0.0, 0.2, 0.29, 0.31, 0.7, 2.0}) {
    Probe probe(onBone(0), 1000);
    probe.at(-0.001, 0);
    probe.go(20, kTop_m);
    for (int i = 1; i <= 500; ++i) {
      const double pressed_m = 1e-5 * i;
      const StepReport report = probe.at(kTop_m + pressed_m, slope * pressed_m);
      const Vec3 force_N = report.wrench_W.force_N;
      const double aside_N = dot(force_N, probe.site().across_1);
      ASSERT_NEAR(force_N.z, kBone_N_per_m * pressed_m, 1e-9);
      ASSERT_NEAR(aside_N, -kBone_N_per_m * pressed_m * std::min(slope, kRubs), 1e-9) << slope;
    }
  }
}

TEST(Bone, withoutFrictionItPushesAlongItsNormalAtAnyAngle) {
  for (const double degrees : {0.0, 30.0, 60.0, 80.0}) {
    Probe probe(onBone(0, 0.0), 1000);
    const double tangent = std::tan(degrees * kDegree);
    probe.tilt(degrees * kDegree);
    probe.at(-0.001, -0.001 * tangent);
    for (const StepReport& report : probe.go(700, 0.020, 0.020 * tangent)) {
      ASSERT_NEAR(report.wrench_W.force_N.x, 0, 1e-9);
      ASSERT_NEAR(report.wrench_W.force_N.y, 0, 1e-9);
    }
    EXPECT_NEAR(probe.last().wrench_W.force_N.z, kBone_N_per_m * 0.010, 1e-9) << degrees;
  }
}

// a bone inclined by 30 degrees under the skin, deeper on one side
TEST(Bone, mayLieAslantUnderAPlaneOfSkin) {
  const double slope = std::tan(30 * kDegree);
  for (const double aside_m : {-0.006, 0.0, 0.006}) {
    SceneSpec scene = onBone(0, 0.0);
    const Site site = defaultSite();
    const Vec3 out = site.across_1 * (2 * slope) - site.inward * 2;  // not normalised
    scene.bone_normal = out;
    Probe probe(scene, 1000);
    probe.at(-0.001, aside_m);
    const double top_m = kTop_m + aside_m * slope;
    for (const StepReport& report : probe.go(340, 0.016, aside_m))
      ASSERT_EQ(report.layer >= 1, report.stage_N[kBoneTerm] > 0) << "by the bone, not by the depth";
    const Vec3 expected_N = normalized(out) * (kBone_N_per_m * (0.016 - top_m) * std::cos(30 * kDegree));
    EXPECT_LE(norm(probe.last().wrench_W.force_N - expected_N), 1e-9) << aside_m;
    EXPECT_GT(norm(expected_N), 1);
  }
}

// at 30 degrees it would stick out of the skin from 17.3 mm aside on; there its surface is the skin
TEST(Bone, thatSlantsEndsAtTheSkin) {
  SceneSpec scene = onBone(0, 0.0);
  const Site site = defaultSite();
  scene.bone_normal = site.across_1 * std::tan(30 * kDegree) - site.inward;
  for (const double aside_m : {-0.018, -0.030, -0.100}) {
    Probe probe(scene, 1000);
    probe.at(-0.001, aside_m);
    for (const StepReport& report : probe.go(40, 0.004, aside_m))
      ASSERT_LE(report.stage_N[kBoneTerm], kBone_N_per_m * 0.004 + 1e-9) << aside_m;
    EXPECT_LE(norm(probe.last().wrench_W.force_N + site.inward * (kBone_N_per_m * 0.004)), 1e-9) << aside_m;
    EXPECT_EQ(probe.last().layer, 1);
  }
  // in on the bone, along the skin and down beside its edge: no energy is given
  MotionBuilder builder(2000, site.p_surface_m - site.inward * 0.002 - site.across_1 * 0.030, site.inward);
  const auto at = [&](double depth_m, double aside_m) {
    return site.p_surface_m + site.inward * depth_m + site.across_1 * aside_m;
  };
  for (int i = 0; i < 3; ++i)
    builder.moveTo(at(0.004, -0.030), 0.1)
        .moveTo(at(0.004, -0.005), 0.1)
        .moveTo(at(0.012, -0.005), 0.1)
        .moveTo(at(0.004, -0.020), 0.1)
        .moveTo(at(-0.002, -0.030), 0.1);
  const Motion motion = builder.take();
  EngineRun run(scene, 2000);
  EXPECT_LE(energyToHand(motion, run.run(motion)), 5e-5);
}

// Dragged along the bone over S, pressed by d: friction takes μKd(S − μd) and the stretch ½K(μd)², which
// slips away as the needle lifts; the normal part is returned completely.
TEST(Bone, frictionTakesItsWorkAndNothingElseIsLost) {
  const Site site = defaultSite();
  const double pressed_m = 0.004, way_m = 0.020;
  MotionBuilder builder(4000, site.p_surface_m - site.inward * 0.001, site.inward);
  const Vec3 down = site.p_surface_m + site.inward * (kTop_m + pressed_m);
  builder.moveTo(down, 1).moveTo(down + site.across_1 * way_m, 1);
  builder.moveTo(site.p_surface_m + site.across_1 * way_m - site.inward * 0.001, 1);
  const Motion motion = builder.take();
  EngineRun run(onBone(0), 4000);
  const double expected_J = -kRubs * kBone_N_per_m * pressed_m * (way_m - 0.5 * kRubs * pressed_m);
  EXPECT_NEAR(energyToHand(motion, run.run(motion)), expected_J, 1e-6);
}

TEST(Bone, theProxyStaysOutsideAndItsForceInTheCone) {
  for (const LimbKind limb : kLimbKinds) {
    int touched = 0;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      EngineRun run(sixLayersOnBone(limb), 1000);
      for (const TipSample& sample : randomGesture(seed, 1000, siteOf(limb))) {
        run.step(sample);
        const BoneContact& bone = run.state().bone;
        if (!bone.touching) continue;
        ++touched;
        ASSERT_NEAR(signedDepth(run.model().limb, bone.p_proxy_W_m), 0.026, 1e-12);
        const Vec3 normal = surfaceNormal(run.model().limb, bone.p_proxy_W_m, {});
        const double pressed_m = dot(bone.stretch_W_m, normal);
        ASSERT_GT(pressed_m, 0);
        // where a round bone is pressed half-way to its centre, the proxy may need further ticks to follow
        if (limb == LimbKind::kCapsule && pressed_m > 0.009) continue;
        ASSERT_LE(norm(bone.stretch_W_m - normal * pressed_m), kRubs * pressed_m * 1.01 + 1e-9)
            << limbName(limb);
      }
    }
    EXPECT_GT(touched, 5000) << limbName(limb);
  }
}

// at 5 m/s, and through the edge of a round bone: in and out within one tick
TEST(Bone, nothingPassesBetweenTwoTicks) {
  SceneSpec scene = onBone(0, 1.0);
  scene.limb = SphereLimb{{0, 0, 0}, 0.030};  // the bone is a ball of 20 mm
  for (const double beside_m : {0.0, 0.005, 0.010, 0.014}) {
    EngineRun run(scene, 1000);
    const Quat axis = pointing({0, 0, -1});
    const double from_m = std::sqrt(0.02 * 0.02 - beside_m * beside_m) + 0.001;
    run.step({{beside_m, 0, 0.031}, axis});
    run.step({{beside_m, 0, from_m + 0.002}, axis});
    run.step({{beside_m, 0, from_m}, axis});
    ASSERT_FALSE(run.state().bone.touching);
    const StepReport beyond = run.step({{beside_m, 0, -from_m}, axis});
    EXPECT_TRUE(run.state().bone.touching) << beside_m;
    EXPECT_GT(beyond.wrench_W.force_N.z, 0) << "back where it came from";
    EXPECT_NEAR(norm(run.state().bone.p_proxy_W_m), 0.020, 1e-12);
  }
  // beside the bone
  EngineRun run(scene, 1000);
  run.step({{0.021, 0, 0.031}, pointing({0, 0, -1})});
  run.step({{0.021, 0, 0.010}, pointing({0, 0, -1})});
  run.step({{0.021, 0, -0.010}, pointing({0, 0, -1})});
  EXPECT_FALSE(run.state().bone.touching);
}

// 25 mm in one tick, as after five ticks bridged by the gate: into the far half of the bone
TEST(Bone, aLongWayIntoTheFarHalfMeetsTheNearSide) {
  SceneSpec scene = onBone(0, 1.0);
  scene.limb = SphereLimb{{0, 0, 0}, 0.022};  // a ball of 12 mm
  EngineRun run(scene, 1000);
  const Quat axis = pointing({0, 0, -1});
  run.step({{0.001, 0, 0.023}, axis});
  run.step({{0.001, 0, 0.013}, axis});
  const StepReport report = run.step({{0.001, 0, -0.0115}, axis});
  EXPECT_NEAR(run.state().bone.p_proxy_W_m.z, 0.012, 1e-3);
  EXPECT_NEAR(report.wrench_W.force_N.z, kBone_N_per_m * 0.0235, 1);
}

// wherever the tip jumps
TEST(Bone, jumpsGiveAFiniteForceAndAProxyOnTheBone) {
  for (const LimbKind limb : kLimbKinds) {
    EngineRun run(sixLayersOnBone(limb), 1000);
    const Site site = siteOf(limb);
    std::uint64_t state = 1;
    const auto random = [&state] {
      state = state * 6364136223846793005u + 1442695040888963407u;
      return static_cast<double>(state >> 40) / 16777216.0;
    };
    int touched = 0;
    for (int i = 0; i < 20'000; ++i) {
      const Vec3 tip = site.p_surface_m + site.inward * (0.15 * random() - 0.01) +
                       site.across_1 * (0.1 * random() - 0.05) + site.across_2 * (0.1 * random() - 0.05);
      const StepReport report = run.step({tip, pointing(tilted(site.inward, random(), site.across_1))});
      ASSERT_LE(norm(report.wrench_W.force_N), 50 * (1 + 1e-9));
      if (!run.state().bone.touching) continue;
      ++touched;
      // inside the bone where the skin on the far side is closer than the spring is long, and outside where
      // it follows a tip that has left: between bone and tip
      const double proxy_m = signedDepth(run.model().limb, run.state().bone.p_proxy_W_m);
      ASSERT_GE(proxy_m, std::min(0.026, signedDepth(run.model().limb, tip)) - 1e-12);
    }
    EXPECT_GT(touched, 1000) << limbName(limb);
  }
}

TEST(Bone, inTheTickOfTheEntryToo) {
  SceneSpec scene = onBone();
  scene.layers[0].thickness_m = 0.002;
  Probe probe(scene, 1000);
  probe.at(-0.001);
  const StepReport report = probe.at(0.004);
  EXPECT_NE(report.flags & kFlagEntry, 0u);
  EXPECT_NEAR(report.stage_N[kBoneTerm], kBone_N_per_m * 0.002, 1e-9);
  const StepReport next = probe.at(0.005);
  EXPECT_NEAR(next.stage_N[kBoneTerm], kBone_N_per_m * 0.003, 1e-9);
  EXPECT_GE(next.attracted_N, 0.0);
}

TEST(Bone, theTissueRelaxesAroundANeedleThatRestsOnTheBone) {
  Probe probe(onBone(), 1000);
  probe.at(-0.001);
  probe.go(800, 0.015);
  probe.stay(3000);
  EXPECT_NEAR(probe.last().cutting_N, -0.1, 1e-3) << "the rejection force is left";
  EXPECT_NEAR(probe.last().stage_N[kBoneTerm], kBone_N_per_m * 0.005, 1e-9) << "bone does not relax";
  for (const StepReport& report : probe.go(500, 0.020)) ASSERT_LE(-report.cutting_N, 0.1 + 1e-3);
}

TEST(Bone, letsGoWithoutAStep) {
  for (const LimbKind limb : kLimbKinds)
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      SceneSpec scene = sixLayersOnBone(limb);
      scene.effects = kBoneBit;
      EngineRun run(scene, 1000);
      const Motion motion = randomGesture(seed, 1000, siteOf(limb));
      Vec3 before_N, before_m = motion.front().p_WT_m;
      for (const TipSample& sample : motion) {
        const Vec3 force_N = run.step(sample).wrench_W.force_N;
        // the cone's share of the motion, plus 20 mm/s for a proxy that falls over an edge
        const double max_m = std::sqrt(2 + kRubs * kRubs) * norm(sample.p_WT_m - before_m) + 2e-5;
        ASSERT_LE(norm(force_N - before_N), 600 * max_m + 1e-4) << limbName(limb) << " " << seed;
        before_N = force_N;
        before_m = sample.p_WT_m;
      }
    }
}

// where the bone reaches the skin the spring is shortened, and the proxy falls over the edge
// A needle that is held aside by e is pushed out by clamping with f = ½ k′ e² x/d_t. On bone the greater of
// both counts, so that a way in that is straight and out that is aside gives at most f²/2K instead of f times
// the depth of the press.
TEST(Bone, andWhatClampingPushesOutAreNotASum) {
  SceneSpec scene = onBone(bitOf(Effect::kClamping), 0.0);
  for (LayerSpec& layer : scene.layers) layer.lateral_stiffness_N_per_m2 = 1e4;
  scene.virtual_fixture = {400, 4, ClampingMode::kConservative};
  const double aside_m = 0.006, push_N = 0.5e4 * aside_m * aside_m * kTop_m / std::hypot(kTop_m, aside_m);
  const Site site = defaultSite();
  Motion motion;
  double depth_m = -0.001, at_m = 0;
  const auto go = [&](int ticks, double to_depth_m, double to_m) {
    for (int i = 1; i <= ticks; ++i) {
      const double share = static_cast<double>(i) / ticks;
      motion.push_back({site.p_surface_m + site.inward * (depth_m + (to_depth_m - depth_m) * share) +
                            site.across_1 * (at_m + (to_m - at_m) * share),
                        pointing(site.inward)});
    }
    depth_m = to_depth_m, at_m = to_m;
    return motion.size() - 1;
  };
  go(1, -0.001, 0);
  go(500, 0.020, 0);
  const auto deep = go(300, 0.020, aside_m), shallow = go(500, kTop_m + 5e-5, aside_m);
  go(500, -0.001, aside_m);
  EngineRun run(scene, 1000);
  const auto reports = run.run(motion);
  EXPECT_NEAR(reports[deep].wrench_W.force_N.z, kBone_N_per_m * 0.010, 1e-9);
  EXPECT_NEAR(reports[shallow].wrench_W.force_N.z, push_N, 1e-9) << "the bone's 0.05 N are not on top";
  EXPECT_LE(energyToHand(motion, reports), push_N * push_N / (2 * kBone_N_per_m) + 1e-6);
}

TEST(Bone, givesNothingAtItsEdge) {
  const Site site = defaultSite();
  GestureRange range;
  range.above_m = 0.003;
  range.below_m = 0.010;
  range.least_leg_s = 0.1;
  range.most_leg_s = 0.6;
  range.legs = 12;
  for (const double degrees : {30.0, 45.0, 60.0})
    for (const double friction : {0.0, kRubs, 1.0, 2.0})
      for (const EffectMask effects : {EffectMask{0}, kAxial})
        for (std::uint64_t seed = 1; seed <= (longForm() ? 100u : 5u); ++seed) {
          SceneSpec scene = onBone(effects, friction);
          scene.layers[0].thickness_m = 0.002;
          scene.bone_normal = site.across_1 * std::tan(degrees * kDegree) - site.inward;
          const Motion motion = randomGesture(seed, 2000, site, range);
          EngineRun run(scene, 2000);
          EXPECT_LE(energyToHand(motion, run.run(motion)), 5e-5) << degrees << " " << friction << " " << seed;
        }
}

TEST(Bone, givesTheHandNothingAndUsesNoHeap) {
  GestureRange range;
  range.least_leg_s = 0.4;
  range.most_leg_s = 1.2;
  for (const LimbKind limb : kLimbKinds)
    for (const double friction : {0.0, kRubs, 1.0})
      for (std::uint64_t seed = 1; seed <= (longForm() ? 300u : 8u); ++seed) {
        const SceneSpec scene = sixLayersOnBone(limb, friction);
        const auto model = std::make_unique<SceneModel>(compiled(scene, 2000));
        const auto state = std::make_unique<SimState>();
        const Motion motion = randomGesture(seed, 2000, siteOf(limb), range);
        std::vector<StepReport> reports(motion.size());
        std::uint64_t calls = 0;
        {
          const NoAllocScope scope;
          for (std::size_t k = 0; k < motion.size(); ++k) step(*model, motion[k], *state, reports[k]);
          calls = scope.calls();
        }
        EXPECT_EQ(calls, 0u);
        EXPECT_LE(energyToHand(motion, reports), 5e-5) << limbName(limb) << " " << friction << " " << seed;
      }
}

// the energy in the springs: the bone's, the walls', and on the bone what the tissue returns over the
// distance it does not feel
double stored_J(const SceneModel& model, const SimState& state, const StepReport& report) {
  if (report.layer < 0) return 0;
  const double bone_N_per_m = model.stage_numbers[kBoneTerm][0],
               along_N = report.cutting_N + report.attracted_N;
  const BoneContact& bone = state.bone;
  return 0.5 * bone_N_per_m * normSquared(bone.stretch_W_m) +
         0.5 * along_N * along_N / model.wall.stiffness_N_per_m +
         0.5 * report.friction_N * report.friction_N / model.friction_stiffness_N_per_m -
         bone.held_m * (along_N + report.friction_N);
}

TEST(Bone, inNoTickTheHandGetsMoreThanTheSpringsHeld) {
  GestureRange range;
  range.above_m = -0.020;  // mostly on the bone
  range.below_m = 0.036;
  range.least_leg_s = 0.2;
  range.most_leg_s = 1.2;
  range.legs = 12;
  for (const LimbKind limb : kLimbKinds)
    for (const double friction : {0.0, kRubs, 1.0})
      for (std::uint64_t seed = 1; seed <= (longForm() ? 100u : 5u); ++seed) {
        SceneSpec scene = sixLayersOnBone(limb, friction);
        scene.effects = kAxial | bitOf(Effect::kShaftFriction) | kBoneBit;
        if (limb == LimbKind::kPlane) scene.bone_normal = Vec3{0.3, -0.2, 1};
        EngineRun run(scene, 2000);
        TipSample before;
        StepReport earlier;
        double held_J = 0;
        int pressed = 0;
        const Motion inside = randomGesture(seed, 2000, siteOf(limb), range);
        const Site site = siteOf(limb);
        MotionBuilder entry(2000, site.p_surface_m - site.inward * 0.002, zAxis(inside.front().q_WT));
        entry.moveTo(inside.front().p_WT_m, 0.5);
        for (const TipSample& sample : joined(entry.take(), inside)) {
          const StepReport report = run.step(sample);
          pressed += run.state().bone.held_m > 0.001 ? 1 : 0;
          const double way_m = norm(sample.p_WT_m - before.p_WT_m);
          const double given_J =
              0.5 * dot(report.wrench_W.force_N + earlier.wrench_W.force_N, sample.p_WT_m - before.p_WT_m);
          const double now_J = stored_J(run.model(), run.state(), report);
          // the trapezoid's error where a spring begins or ends within the tick
          if (earlier.layer >= 0) {
            ASSERT_LE(given_J, held_J - now_J + 1240 * way_m * way_m + 1e-9)
                << limbName(limb) << " " << friction << " " << seed;
          }
          before = sample;
          earlier = report;
          held_J = now_J;
        }
        EXPECT_GT(pressed, 100);
      }
}

// pressed while the tissue rests, dragged down along the bone, lifted, repeatedly: the tissue's extra stretch
// after the way down must not push the needle out
TEST(Bone, tissueThatIsSlippedThroughDoesNotPushOutMore) {
  const Site site = defaultSite();
  const Vec3 axis = tilted(site.inward, 1.0, site.across_1);
  MotionBuilder builder(2000, site.p_surface_m - axis * 0.002, axis);
  Vec3 place = site.p_surface_m + axis * 0.016;
  builder.moveTo(place, 0.5).hold(2.0);
  const Vec3 along = site.across_1 * 0.006;
  const Motion motion = builder.moveTo(place + along, 0.3).take();
  EngineRun run(onBone(kAxial, 0.0), 2000);
  double held_N = 1e9, min_m = 1e9, max_m = 0;
  for (const TipSample& sample : motion) {
    const StepReport report = run.step(sample);
    if (!(run.state().bone.held_m > 0)) continue;
    EXPECT_LE(-report.cutting_N, held_N + 1e-12);
    held_N = -report.cutting_N;
    const double proxy_m = dot(run.state().u_W, run.state().bone.p_proxy_W_m - run.state().p_entry_W_m);
    min_m = std::min(min_m, proxy_m);
    max_m = std::max(max_m, proxy_m);
  }
  EXPECT_GT(max_m - min_m, 0.003) << "more than the wall's reach of 2 mm";
  EXPECT_NEAR(held_N, 0.1, 0.01) << "as it was at rest: it has not grown on the way";
}

// a membrane 2 mm above the bone, with a needle inclined by 1 rad: dragging 5 mm down along the bone
// stretches it by 5 mm more, while it does not feel 2.7 mm of pressing. Lifting and returning above the bone
// gave 4 mJ each time
TEST(Bone, aMembraneThatIsSlippedUnderDoesNotPushOutMore) {
  SceneSpec scene = onBone(0, 0.0);
  scene.layers[0].thickness_m = 0.008;
  LayerSpec capsule = scene.layers[0];
  capsule.thickness_m = 0.002;
  capsule.membrane = MembraneSpec{300, 0, 40};
  scene.layers.insert(scene.layers.begin() + 1, capsule);
  scene.effects |= bitOf(Effect::kPuncture);
  const Site site = defaultSite();
  const Vec3 axis = tilted(site.inward, 1.0, site.across_1);
  const auto at = [&](double depth_m, double aside_m) {
    return site.p_surface_m + site.inward * depth_m + site.across_1 * aside_m;
  };
  const double aside_m = kTop_m * std::tan(1.0), further_m = aside_m + 0.006;
  MotionBuilder builder(2000, site.p_surface_m - axis * 0.002, axis);
  builder.moveTo(at(0.0099, aside_m), 0.1);
  for (int i = 0; i < 3; ++i)
    builder.moveTo(at(0.015, aside_m), 0.1)
        .moveTo(at(0.015, further_m), 0.1)
        .moveTo(at(0.0099, further_m), 0.1)
        .moveTo(at(0.0099, aside_m), 0.1);
  const Motion motion = builder.moveTo(site.p_surface_m - axis * 0.002, 0.1).take();
  EngineRun run(scene, 2000);
  double held_N = 1e9, max_N = 0;
  std::vector<StepReport> reports;
  for (const TipSample& sample : motion) {
    reports.push_back(run.step(sample));
    max_N = std::max(max_N, -reports.back().puncture_N);
    if (run.state().bone.held_m > 0) {
      EXPECT_LE(-reports.back().puncture_N, held_N + 1e-12);
    }
    held_N = run.state().bone.held_m > 0 ? -reports.back().puncture_N : 1e9;
  }
  EXPECT_NEAR(max_N, 300 * (0.0099 - 0.008) / std::cos(1.0), 0.05) << "as far as the hand stretched it";
  EXPECT_LE(energyToHand(motion, reports), 5e-5);
}

TEST(Bone, isPartOfTheStateAndOfItsHash) {
  const SceneSpec scene = sixLayersOnBone(LimbKind::kCapsule);
  const auto model = std::make_unique<SceneModel>(compiled(scene, 1000));
  const auto state = std::make_unique<SimState>(), copy = std::make_unique<SimState>();
  const auto kept = std::make_unique<SimState>();
  const Motion motion = randomGesture(12, 1000, siteOf(LimbKind::kCapsule));
  StepReport report, copied;
  for (std::size_t k = 0; k < motion.size(); ++k) {
    step(*model, motion[k], *state, report);
    if (kept->bone.touching) {
      step(*model, motion[k], *copy, copied);
      ASSERT_EQ(hashOf(*state), hashOf(*copy)) << k;
      ASSERT_EQ(report.wrench_W, copied.wrench_W) << k;
    } else if (state->bone.touching) {
      *kept = *copy = *state;
    }
  }
  ASSERT_TRUE(kept->bone.touching);
  const std::uint64_t whole = hashOf(*kept);
  const auto changes = [&](auto change) {
    *copy = *kept;
    change(copy->bone);
    return hashOf(*copy) != whole;
  };
  EXPECT_TRUE(changes([](BoneContact& bone) { bone.touching = false; }));
  EXPECT_TRUE(changes([](BoneContact& bone) { bone.p_proxy_W_m.x += 1e-9; }));
  EXPECT_TRUE(changes([](BoneContact& bone) { bone.stretch_W_m.y += 1e-9; }));
  EXPECT_TRUE(changes([](BoneContact& bone) { bone.held_m += 1e-9; }));
  EXPECT_TRUE(changes([](BoneContact& bone) { bone.cutting_N += 1.0; }));
  EXPECT_TRUE(changes([](BoneContact& bone) { bone.friction_N += 1.0; }));
  EXPECT_TRUE(changes([](BoneContact& bone) { bone.place_m = 1.0; }));
}

TEST(Bone, isOfTheStiffnessOfTheScene) {
  const EffectMask rubbing = kAxial | bitOf(Effect::kShaftFriction) | bitOf(Effect::kPuncture);
  const auto along_N_per_m = [&](double bone_N_per_m) {
    SceneSpec scene = withBone(onBone(), rubbing, bone_N_per_m);
    scene.layers[0].friction_N_per_m = 10;
    scene.layers[0].membrane = MembraneSpec{450, 0, 0.4};
    return compiled(scene, 1000).axialStiffness_N_per_m();
  };
  EXPECT_NEAR(along_N_per_m(1000), 1000, 1e-9) << "the tissue's springs do not stretch on the bone";
  EXPECT_NEAR(along_N_per_m(700), 700, 1e-9) << "nor do membrane and tissue add";
  EXPECT_NEAR(along_N_per_m(300), 640, 1e-9);
}

TEST(Bone, numbersOutOfRangeAreNamed) {
  const auto refusal = [](double stiffness, double friction) {
    const Status status = validate(withBone(onBone(), kAxial, stiffness, friction));
    return status.ok() ? std::string() : status.error().message;
  };
  EXPECT_EQ(refusal(1, 0), "");
  EXPECT_EQ(refusal(10'000, 2), "");
  EXPECT_EQ(refusal(0, 0.3), "bone.stiffness_n_per_m: 0 is out of range (0, 10000]");
  EXPECT_EQ(refusal(600, 2.1), "bone.friction_coefficient: 2.1 is out of range [0, 2]");
  SceneSpec bare = onBone();
  bare.layers.erase(bare.layers.begin());
  EXPECT_EQ(validate(bare).error().message,
            "layers[0].tissue: is BONE, and effects lists BONE: bone needs another layer above it");
  bare.effects = kAxial;
  EXPECT_TRUE(validate(bare).ok());
  const auto refusalOf = [](Vec3 normal, LimbKind limb) {
    SceneSpec scene = withLimb(onBone(), limb);
    scene.bone_normal = normal;
    const Status status = validate(scene);
    return status.ok() ? std::string() : status.error().message;
  };
  EXPECT_EQ(refusalOf({1.7, 0, 1}, LimbKind::kPlane), "");
  EXPECT_EQ(refusalOf({1.8, 0, 1}, LimbKind::kPlane),
            "bone.normal: is more than 60 degrees from the skin's normal");
  EXPECT_EQ(refusalOf({0, 0, 0}, LimbKind::kPlane),
            "bone.normal: is not a direction: give a vector that is not zero, pointing out of the bone");
  EXPECT_EQ(refusalOf({0, 0, 1}, LimbKind::kSphere),
            "bone.normal: is given, but limb is not a plane: its bone is as round as its skin");
  EXPECT_EQ(refusalOf({std::nan(""), 0, 1}, LimbKind::kPlane).substr(0, 14), "bone.normal.x:");
}

}  // namespace
}  // namespace needlelab::test
