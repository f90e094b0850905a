// Every combination of effects: additive effects add up; an effect that is not live gives no force and does
// not change the others.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <set>

#include "common/haptics/effects/effect_entry.h"
#include "tests/support/sanitized.h"
#include "tests/unit/common/haptics/probe.h"

namespace needlelab::test {
namespace {

constexpr EffectMask kC = bitOf(Effect::kCutting), kA = bitOf(Effect::kAttracted),
                     kV = bitOf(Effect::kClamping), kO = bitOf(Effect::kOrientationLimit),
                     kF = bitOf(Effect::kShaftFriction), kP = bitOf(Effect::kPuncture),
                     kM = bitOf(Effect::kCutMemory);

// all numbers set; the fixture never reaches its maximum, so u does not turn
SceneSpec fullScene() {
  SceneSpec scene = allEffects();
  scene.virtual_fixture.max_force_N = 50;
  scene.max_force_N = 50;
  for (const EffectEntry* entry : effectEntries())
    if (!isPlaced(entry->effect)) useUsualNumbers(*entry, scene);
  // bone below all gestures: it would restrain what the others feel (bone_test.cpp)
  scene.layers.back().thickness_m = 0.2;
  LayerSpec bone;
  bone.thickness_m = 0.01;
  bone.is_bone = true;
  scene.layers.push_back(bone);
  return scene;
}

Motion theMotion() {
  GestureRange range;
  range.legs = 5;
  range.aside_m = 0;
  range.tilt_tangent = 0.0001;  // in a straight line, so that u does not turn: a turn changes all lengths
  Motion motion = insertHoldWithdraw(1000, defaultSite(), {0, 0, -1}, {0, 0, -1}, 0.035, 0.05, 1.0);
  return joined(motion, randomGesture(21, 1000, defaultSite(), range));
}

// a sanitizer sees every effect and every pair in a part of the sets
constexpr EffectMask kStep = kSanitized ? 11 : 1;

std::vector<StepReport> runWith(EffectMask mask, const Motion& motion) {
  EngineRun run(withEffects(fullScene(), mask), 1000);
  return run.run(motion);
}

TEST(Effects, everyCombinationIsTheSumOfItsParts) {
  const Motion motion = theMotion();
  std::map<EffectMask, std::vector<StepReport>> parts;
  const auto part = [&](EffectMask mask) -> const std::vector<StepReport>& {
    auto [at, fresh] = parts.try_emplace(mask);
    if (fresh) at->second = runWith(mask, motion);
    return at->second;
  };
  for (EffectMask mask = 0; mask <= kNeedleEffects; mask += kStep) {
    const auto& all = part(mask);
    // cutting and attracted share a wall; membranes restrain both walls; the memory of the cut opens
    // membranes and moves the cutting wall; friction relaxes in stops, which end by the wall's stretch; no
    // other effects interact
    const auto &wall = part(mask & (kC | kA | kP | kM)), &rubbing = part(mask & (kC | kA | kF | kP | kM)),
               &membranes = part(mask & (kP | kM)), &fixture = part(mask & kV), &tilt = part(mask & kO);
    for (std::size_t k = 0; k < motion.size(); ++k) {
      ASSERT_EQ(all[k].cutting_N, wall[k].cutting_N) << "mask " << mask << " tick " << k;
      ASSERT_EQ(all[k].attracted_N, wall[k].attracted_N) << "mask " << mask << " tick " << k;
      ASSERT_EQ(all[k].friction_N, rubbing[k].friction_N) << "mask " << mask << " tick " << k;
      ASSERT_EQ(all[k].puncture_N, membranes[k].puncture_N) << "mask " << mask << " tick " << k;
      ASSERT_EQ(all[k].clamping_N, fixture[k].clamping_N) << "mask " << mask << " tick " << k;
      ASSERT_EQ(all[k].wrench_W.torque_Nm, tilt[k].wrench_W.torque_Nm) << "mask " << mask << " tick " << k;
      Vec3 sum = rubbing[k].wrench_W.force_N + fixture[k].wrench_W.force_N;
      // A stage depends on the results of the others, especially ruptures.
      for (const EffectEntry* entry : effectEntries())
        if (const EffectMask stage = mask & bitOf(entry->effect);
            !isPlaced(entry->effect) && entry->value != nullptr && stage != 0)
          sum = sum + part(stage | (mask & (kP | kM)))[k].wrench_W.force_N - membranes[k].wrench_W.force_N;
      ASSERT_LE(norm(all[k].wrench_W.force_N - sum), 1e-9) << "mask " << mask << " tick " << k;
    }
  }
}

TEST(Effects, whatIsNotLiveGivesZero) {
  const Motion motion = theMotion();
  for (EffectMask mask = 0; mask <= kNeedleEffects; mask += kStep)
    for (const StepReport& report : runWith(mask, motion)) {
      if (!(mask & kC)) {
        ASSERT_EQ(report.cutting_N, 0.0);
      }
      if (!(mask & kA)) {
        ASSERT_EQ(report.attracted_N, 0.0);
      }
      if (!(mask & kF)) {
        ASSERT_EQ(report.friction_N, 0.0);
      }
      if (!(mask & kP)) {
        ASSERT_EQ(report.puncture_N, 0.0);
      }
      if (!(mask & kP)) {
        ASSERT_FALSE(report.flags & kFlagRupture);
      }
      if (!(mask & kV)) {
        ASSERT_EQ(report.clamping_N, 0.0);
      }
      if (!(mask & kV)) {
        ASSERT_EQ(report.clamping_stiffness_N_per_m, 0.0);
      }
      if (!(mask & kO)) {
        ASSERT_EQ(report.wrench_W.torque_Nm, Vec3{});
      }
      if (mask == 0) {
        ASSERT_EQ(report.wrench_W, Wrench{});
      }
      ASSERT_EQ(std::isnan(report.p_wall_W_m.x), !(mask & (kC | kA)) || report.layer < 0);
    }
}

TEST(Effects, theNeedlesPlaceIsReportedForAllEffectSets) {
  const Motion motion = theMotion();
  const auto without = runWith(0, motion), with = runWith(kAllEffects, motion);
  for (std::size_t k = 0; k < motion.size(); ++k) {
    // a stop ends by a spring's stretch, if there is one
    if (without[k].phase != Phase::kStopped && with[k].phase != Phase::kStopped)
      ASSERT_EQ(without[k].phase, with[k].phase);
    ASSERT_EQ(without[k].layer, with[k].layer);
    ASSERT_EQ(without[k].depth_m, with[k].depth_m);
    ASSERT_EQ(without[k].insertion_m, with[k].insertion_m);
    ASSERT_EQ(without[k].speed_mps, with[k].speed_mps);
    ASSERT_EQ(without[k].lateral_error_m, with[k].lateral_error_m);
  }
}

TEST(Effects, anEffectWhoseNumbersAreAllZeroIsNotLive) {
  SceneSpec scene = withEffects(allEffects(), kAllEffects);
  for (auto& layer : scene.layers) {
    layer = LayerSpec{};
    layer.thickness_m = 0.01;
  }
  scene.orientation_limit = {0, 0};
  const SceneModel model = compiled(scene, 1000);
  for (std::size_t i = 0; i < kEffectCount; ++i)
    EXPECT_FALSE(model.isLive(static_cast<Effect>(i))) << effectName(static_cast<Effect>(i));
  EXPECT_EQ(model.axialStiffness_N_per_m(), 0.0);
}

TEST(Effects, oneNumberInOneLayerIsEnoughToBeLive) {
  const auto liveOf = [](auto change) {
    SceneSpec scene = withEffects(paperOneDof(), kAllEffects);
    scene.layers.assign(3, LayerSpec{});
    for (auto& layer : scene.layers) layer.thickness_m = 0.01;
    change(scene);
    return compiled(scene, 1000).live;
  };
  EXPECT_EQ(liveOf([](SceneSpec& s) { s.layers[1].cutting_force_N = 1; }), kC);
  EXPECT_EQ(liveOf([](SceneSpec& s) { s.layers[2].attracted_force_N = 1; }), kA);
  EXPECT_EQ(liveOf([](SceneSpec& s) { s.layers[0].lateral_stiffness_N_per_m2 = 1; }), kV);
  EXPECT_EQ(liveOf([](SceneSpec& s) { s.layers[1].friction_N_per_m = 1; }), kF);
  EXPECT_EQ(liveOf([](SceneSpec& s) { s.layers[2].membrane = MembraneSpec{1, 0, 1}; }), kP);
  EXPECT_EQ(liveOf([](SceneSpec& s) { s.orientation_limit = {1, 1}; }), kO);
}

TEST(Effects, whatIsNotListedIsNotLiveThoughItHasNumbers) {
  for (EffectMask mask = 0; mask <= kAllEffects; ++mask)
    EXPECT_EQ(compiled(withEffects(fullScene(), mask), 1000).live, mask);
}

TEST(Effects, theSumIsCappedKeepingItsDirection) {
  SceneSpec scene = fullScene();
  scene.max_force_N = 1.5;
  EngineRun capped(scene, 1000), free(fullScene(), 1000);
  int caps = 0;
  for (const auto& sample : theMotion()) {
    const StepReport a = capped.step(sample), b = free.step(sample);
    const double size = norm(b.wrench_W.force_N);
    ASSERT_EQ((a.flags & kFlagForceCapped) != 0, size > 1.5);
    ASSERT_LE(norm(a.wrench_W.force_N), 1.5 + 1e-12);
    if (size <= 1.5) continue;
    ++caps;
    ASSERT_LE(norm(a.wrench_W.force_N - b.wrench_W.force_N * (1.5 / size)), 1e-12);
    ASSERT_EQ(a.cutting_N, b.cutting_N) << "the parts are reported before the cap";
  }
  EXPECT_GT(caps, 100);
}

// slope k1 + 2 k2 z where k1 z + k2 z² = force
double slopeAtRupture(double k1, double k2, double force) {
  const double z = k2 == 0 ? force / k1 : (-k1 + std::sqrt(k1 * k1 + 4 * k2 * force)) / (2 * k2);
  return k1 + 2 * k2 * z;
}

TEST(Effects, tissueAndTheSteepestMembraneDoNotActAtOnce) {
  SceneSpec scene = allEffects();
  const auto atOnce = [&](EffectMask effects) {
    return compiled(withEffects(scene, effects), 1000).axialStiffness_N_per_m();
  };
  EXPECT_NEAR(atOnce(kC), 500, 1e-12);
  EXPECT_NEAR(atOnce(kF), 140, 1e-12);
  EXPECT_NEAR(atOnce(kC | kF), 500 + 140, 1e-12);
  const double steepest = std::max(
      {slopeAtRupture(200, 20'000, 0.6), slopeAtRupture(100, 60'000, 0.8), slopeAtRupture(300, 0, 0.5)});
  EXPECT_NEAR(atOnce(kP), steepest, 1e-9);
  EXPECT_NEAR(atOnce(kPlacedEffects), 640, 1e-9) << "the tissue is stiffer";
  scene.layers[1].membrane = MembraneSpec{300, 1e6, 0.8};
  EXPECT_NEAR(atOnce(kPlacedEffects), slopeAtRupture(300, 1e6, 0.8), 1e-9) << "that membrane is stiffer";
}

TEST(Effects, theFixtureActsWithTissueAndMembraneTheHubWithTissueOnly) {
  SceneSpec scene = withClamping(fullScene(), ClampingMode::kConservative);
  const double fixture = compiled(scene, 1000).fixture_steepness.along_N_per_m;
  ASSERT_GT(fixture, 10);
  const auto alongOf = [&](EffectMask effects) {
    return alongStiffness(compiled(withEffects(scene, effects), 1000));
  };
  constexpr EffectMask kHub = bitOf(Effect::kHub), kBone = bitOf(Effect::kBone),
                       kCap = bitOf(Effect::kPalpation);
  EXPECT_NEAR(alongOf(kPlacedEffects).atOnce(), 640 + fixture, 1e-9);
  EXPECT_NEAR(alongOf(kP | kV).atOnce(), slopeAtRupture(100, 60'000, 0.8) + fixture, 1e-9);
  EXPECT_NEAR(alongOf(kP | kHub).atOnce(), slopeAtRupture(100, 60'000, 0.8), 1e-9) << "the hub's is 300";
  EXPECT_NEAR(alongOf(kPlacedEffects | kHub).hub_N_per_m, 640 + 300, 1e-9);
  EXPECT_NEAR(alongOf(kPlacedEffects | kHub).atOnce(), 640 + std::max(300.0, fixture), 1e-9);
  EXPECT_NEAR(alongOf(kC | kF | kBone).atOnce(), 640, 1e-9) << "the bone's 600 act alone";
  EXPECT_NEAR(alongOf(kC | kBone).atOnce(), 600, 1e-9);
  EXPECT_NEAR(alongOf(kPlacedEffects | kBone | kCap).alone_N_per_m, 705, 1e-9) << "under the cap 105 + 600";
}

TEST(EffectEntries, haveDistinctNamesTermsAndPlaces) {
  std::set<std::string_view> names, terms;
  std::set<int> places;
  for (std::size_t i = 0; i < kEffectCount; ++i) {
    const EffectEntry& entry = *effectEntries()[i];
    EXPECT_EQ(entry.effect, static_cast<Effect>(i)) << entry.name;
    EXPECT_TRUE(names.insert(entry.name).second) << entry.name;
    EXPECT_TRUE(terms.insert(entry.term).second) << entry.term;
    EXPECT_TRUE(places.insert(entry.place).second) << entry.name << " is shown where another one is";
    EXPECT_EQ(entry.value == nullptr, entry.effect == Effect::kCutMemory)
        << entry.name << ": without a term it acts on the others' terms";
    EXPECT_EQ(entry.stage != nullptr,
              !isPlaced(entry.effect) && entry.effect != Effect::kHub && entry.effect != Effect::kPalpation)
        << entry.name;
    for (const EffectField& field : entry.fields)
      EXPECT_TRUE(field.range.contains(field.begins_with)) << entry.name << "." << field.name;
  }
}

TEST(Stages, costNothingInASceneWithoutThem) {
  for (EffectMask mask = 0; mask <= kPlacedEffects; ++mask) {
    const SceneModel model = compiled(withEffects(fullScene(), mask), 1000);
    EXPECT_EQ(model.step_function, model.placed_step) << "the tick itself runs, and knows nothing of stages";
    EXPECT_EQ(model.stage_count, 0U);
  }
}

// only a scene that restrains its tip asks before each tick where the tissue feels it
TEST(Stages, costNothingInASceneOfAnotherOne) {
  const auto stepOf = [](EffectMask stages) {
    return compiled(withEffects(fullScene(), kPlacedEffects | stages), 1000).step_function;
  };
  EXPECT_EQ(stepOf(bitOf(Effect::kCutMemory)), stepWithStages);
  EXPECT_EQ(stepOf(bitOf(Effect::kBone)), stepHeld);
  EXPECT_EQ(stepOf(bitOf(Effect::kCutMemory) | bitOf(Effect::kBone)), stepHeld);
}

// Half a newton along u; counts the ticks of the insertion.
Vec3 plantedStage(const SceneModel&, const TipSample&, SimState& state, StepReport& report) noexcept {
  state.stage[0][0] += 1.0;
  report.stage_N[0] = 0.5;
  return state.u_W * 0.5;
}

SceneModel withPlantedStage(const SceneSpec& scene) {
  SceneModel model = compiled(scene, 1000);
  model.stages[0] = plantedStage;
  model.stage_count = 1;
  model.step_function = stepWithStages;
  model.surely_below_cap_N = std::numeric_limits<double>::infinity();
  return model;
}

TEST(Stages, addTheirForceInTheTissueOnlyAndForgetAtAnEntry) {
  const SceneSpec scene = withEffects(fullScene(), kPlacedEffects);
  const SceneModel plain = compiled(scene, 1000), staged = withPlantedStage(scene);
  const auto state = std::make_unique<SimState>(), staged_state = std::make_unique<SimState>();
  double ticks_inside = 0;
  int entries = 0;
  for (const TipSample& sample : theMotion()) {
    StepReport without, with;
    step(plain, sample, *state, without);
    step(staged, sample, *staged_state, with);
    const bool inside = without.layer >= 0;
    if ((without.flags & kFlagEntry) != 0) {
      ticks_inside = 0;
      ++entries;
    }
    ticks_inside += inside ? 1 : 0;
    const Vec3 more = inside ? staged_state->u_W * 0.5 : Vec3{};
    ASSERT_EQ(with.wrench_W.force_N, without.wrench_W.force_N + more);
    ASSERT_EQ(with.wrench_W.torque_Nm, without.wrench_W.torque_Nm);
    ASSERT_EQ(with.stage_N[0], inside ? 0.5 : 0.0);
    if (inside) {
      ASSERT_EQ(staged_state->stage[0][0], ticks_inside);
    }
  }
  EXPECT_GT(entries, 1);
}

TEST(Stages, theCapHoldsTheSumWithThem) {
  SceneSpec scene = withEffects(fullScene(), kPlacedEffects);
  scene.max_force_N = 0.6;
  const SceneModel staged = withPlantedStage(scene);
  scene.max_force_N = 50;
  const SceneModel free = withPlantedStage(scene);
  const auto state = std::make_unique<SimState>(), free_state = std::make_unique<SimState>();
  int capped = 0;
  for (const TipSample& sample : theMotion()) {
    StepReport with, uncapped;
    step(staged, sample, *state, with);
    step(free, sample, *free_state, uncapped);
    const double size = norm(uncapped.wrench_W.force_N);
    const Vec3 expected = uncapped.wrench_W.force_N * (size > 0.6 ? 0.6 / size : 1.0);
    ASSERT_LE(norm(with.wrench_W.force_N - expected), 1e-12);
    ASSERT_EQ((with.flags & kFlagForceCapped) != 0, size > 0.6);
    capped += size > 0.6 ? 1 : 0;
  }
  EXPECT_GT(capped, 100);
}

}  // namespace
}  // namespace needlelab::test
