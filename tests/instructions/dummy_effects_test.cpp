// The engine with four more effects (dummy_effects.cpp), compiled from the same files. Here: they act where
// they are live, and what iterates over the rows shows them. instruction_test counts what they cost where
// they are not: it runs this program under callgrind.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <tuple>

#include "client/effect_cost/tick_cost.h"
#include "client/sim/tools/run_table.h"
#include "client/view/model/gesture_replica.h"
#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/effects/step_live.h"
#include "tests/support/scenes/scenes.h"

namespace needlelab::test {
namespace {

constexpr double kRateHz = 250;
constexpr std::size_t kFirstDummy = kEffectCount - kDummyEffectCount;
constexpr EffectMask kDummies = kAllEffects & ~((EffectMask{1} << kFirstDummy) - 1);

// Step functions take most of the engine's compile time: one more stage must not make more of them.
static_assert(std::tuple_size_v<StepTable> == EffectMask{1} << kPlacedEffectCount);

std::span<const EffectEntry* const, kDummyEffectCount> dummyEntries() {
  return effectEntries().last<kDummyEffectCount>();
}

// all stages have numbers, the dummies among them, listed or not
SceneSpec sceneWith(EffectMask effects) {
  SceneSpec scene = withEffects(allEffects(), effects);
  scene.layers.back().is_bone = true;
  for (const EffectEntry* entry : effectEntries())
    if (!isPlaced(entry->effect)) useUsualNumbers(*entry, scene);
  return scene;
}

// The counted program: each set without the dummies, in the order of the mask; at the end none but the
// dummies.
int runSets() {
  const auto gesture = measuringGesture(allEffects(), kRateHz);
  const auto run = [&](EffectMask effects) {
    const SceneModel model = *compile(sceneWith(effects), kRateHz);
    TickRun ticks(model, gesture);
    for (std::size_t k = 0; k < gesture.size(); ++k) ticks.tick();
    endCountedPart();
  };
  for (EffectMask effects = 0; effects <= kPlacedEffects; ++effects) run(effects);
  run(kDummies);
  return 0;
}

TEST(DummyEffects, areRowsLikeTheOthers) {
  EXPECT_THAT(effectNames(kDummies), testing::ElementsAre("DUMMY_A", "DUMMY_B", "DUMMY_C", "DUMMY_D"));
  for (const EffectEntry* dummy : dummyEntries()) EXPECT_EQ(&effectEntry(dummy->effect), dummy);
  EXPECT_EQ(effectsAsShown().back(), dummyEntries().back());
  const auto whole = compile(sceneWith(kAllEffects), kRateHz);
  ASSERT_TRUE(whole.ok()) << whole.error().message;
  EXPECT_EQ(whole->live, kAllEffects);
  EXPECT_EQ(alongStiffness(*whole).tissue_N_per_m,
            alongStiffness(*compile(sceneWith(kPlacedEffects), kRateHz)).tissue_N_per_m + 10 + 20 + 30 + 40);
  EXPECT_FALSE(compile(sceneWith(kAllEffects + 1), kRateHz).ok())
      << "there is no effect behind the last dummy";
  SceneSpec beyond = sceneWith(kAllEffects);
  dummyEntries()[2]->fields[0].of(beyond) = 10'001;
  EXPECT_THAT(compile(beyond, kRateHz).error().message, testing::HasSubstr("dummy_c.stiffness_n_per_m"));
}

TEST(DummyEffects, doNotRunWhereTheyAreNotLive) {
  for (EffectMask effects = 0; effects <= kPlacedEffects; ++effects)
    for (const SceneSpec& scene :
         {sceneWith(effects), withEffects(allEffects(), effects | kDummies) /* all numbers zero */}) {
      const SceneModel model = *compile(scene, kRateHz);
      EXPECT_EQ(model.live, effects);
      EXPECT_EQ(model.stage_count, 0U);
      EXPECT_EQ(model.step_function, (*axialEntry(AxialModel::kEnhancedTrackingWall).steps)[effects]);
    }
}

TEST(DummyEffects, addTheirForcesWhereTheyAreLive) {
  const auto gesture = measuringGesture(allEffects(), kRateHz);
  for (EffectMask dummies = kDummies; dummies != 0; dummies = (dummies - 1) & kDummies) {
    SceneSpec with_dummies = sceneWith(kPlacedEffects | dummies), without_dummies = sceneWith(kPlacedEffects);
    with_dummies.max_force_N = without_dummies.max_force_N = 50;
    const SceneModel model = *compile(with_dummies, kRateHz), plain = *compile(without_dummies, kRateHz);
    const auto state = std::make_unique<SimState>(), plain_state = std::make_unique<SimState>();
    for (const TipSample& sample : gesture) {
      StepReport with, without;
      step(model, sample, *state, with);
      step(plain, sample, *plain_state, without);
      Vec3 force_W = without.wrench_W.force_N;
      for (std::size_t i = 0; i < kDummyEffectCount; ++i) {
        const EffectEntry& dummy = *dummyEntries()[i];
        const bool acts = (dummies & bitOf(dummy.effect)) != 0 && without.layer >= 0;
        const double expected_N = acts ? -10.0 * static_cast<double>(i + 1) * without.insertion_m : 0.0;
        ASSERT_EQ(dummy.value(with), expected_N) << dummy.name;
        force_W = force_W + plain_state->u_W * expected_N;
      }
      ASSERT_LE(norm(with.wrench_W.force_N - force_W), 1e-12);
      ASSERT_EQ(with.wrench_W.torque_Nm, without.wrench_W.torque_Nm);
      for (const EffectEntry* other : effectsAsShown())
        if (other->stage == nullptr) {
          ASSERT_EQ(other->value(with), other->value(without)) << other->name;
        }
    }
  }
}

TEST(DummyEffects, areShownByEverythingThatIteratesOverTheRows) {
  StepReport report;
  Moment moment;
  for (std::size_t i = 0; i < kDummyEffectCount; ++i)
    report.stage_N[stageOf(dummyEntries()[i]->effect)] = -1.5 - static_cast<double>(i);
  moment.terms = termsOf(report);
  for (const EffectEntry* dummy : dummyEntries())
    EXPECT_EQ(termOf(*dummy, moment), dummy->value(report)) << "a view's term";
  EXPECT_THAT(runHeader(), testing::EndsWith(",dummy_a_n,dummy_b_n,dummy_c_n,dummy_d_n\n"));
  std::string row;
  appendRunRow(row, 0, report, 0.06);
  EXPECT_THAT(row, testing::EndsWith(",-1.5,-2.5,-3.5,-4.5\n"));
}

}  // namespace
}  // namespace needlelab::test

// Under callgrind the program only runs the sets.
int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "--run-sets") == 0) return needlelab::test::runSets();
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
