#include "client/effect_cost/tick_cost.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

#include "common/haptics/effects/effect_entry.h"
#include "tests/support/anatomy/bodies.h"
#include "tests/support/scenes/scenes.h"

namespace needlelab::test {
namespace {

// What a gesture does in a scene.
struct Seen {
  std::set<int> layers;
  std::set<Phase> phases;
  std::uint32_t flags = 0;
  std::size_t outside = 0;
  double deepest_m = 0;
};

Seen seenBy(const SceneSpec& scene, double rate_hz, const std::vector<TipSample>& gesture) {
  const SceneModel model = *compile(scene, rate_hz);
  const auto state = std::make_unique<SimState>();
  Seen seen;
  StepReport report;
  for (const TipSample& sample : gesture) {
    step(model, sample, *state, report);
    seen.layers.insert(report.layer);
    seen.phases.insert(report.phase);
    seen.flags |= report.flags;
    if (report.phase == Phase::kFree) ++seen.outside;
    seen.deepest_m = std::max(seen.deepest_m, report.insertion_m);
  }
  return seen;
}

TEST(MeasuringGesture, visitsAllLayersAndPhasesAlmostEntirelyInTissue) {
  for (const LimbKind kind : kLimbKinds)
    for (const double rate_hz : {250.0, 1000.0, 8000.0}) {
      const SceneSpec scene = withLimb(allEffects(), kind);
      const Seen seen = seenBy(scene, rate_hz, measuringGesture(scene, rate_hz));
      EXPECT_EQ(seen.outside, 1u) << limbName(kind) << " " << rate_hz;
      // a capsule of 45 mm ends inside the sixth layer, after its top but before its full 10 mm
      for (int layer = 0; layer < 6; ++layer)
        EXPECT_TRUE(seen.layers.contains(layer)) << limbName(kind) << layer;
      EXPECT_EQ(seen.phases.size(), 4u) << limbName(kind) << " " << rate_hz;
      EXPECT_TRUE(seen.flags & kFlagRupture);
      EXPECT_FALSE(seen.flags &
                   (kFlagTurn | kFlagTorque | kFlagNotStepped | kFlagStartedInside | kFlagBeyondNeedle))
          << limbName(kind) << " " << seen.flags;
    }
}

TEST(MeasuringGesture, staysWithinAShortNeedleAndASmallLimb) {
  SceneSpec scene = allEffects();
  scene.needle_length_m = 0.02;
  EXPECT_LE(seenBy(scene, 1000, measuringGesture(scene, 1000)).deepest_m, 0.0181);
  scene.limb = SphereLimb{{0, 0, 0}, 0.01};
  const Seen seen = seenBy(scene, 1000, measuringGesture(scene, 1000));
  EXPECT_GT(seen.deepest_m, 0.006);
  EXPECT_LE(seen.deepest_m, 0.0085);
}

TEST(TickRun, repeatsTheGesture) {
  const SceneModel model = *compile(allEffects(), 250);
  const auto gesture = measuringGesture(allEffects(), 250);
  TickRun run(model, gesture);
  const auto state = std::make_unique<SimState>();
  StepReport expected;
  double deepest_m = 0;
  for (int round = 0; round < 3; ++round)
    for (const TipSample& sample : gesture) {
      step(model, sample, *state, expected);
      run.tick();
      ASSERT_EQ(run.report().insertion_m, expected.insertion_m) << "round " << round;
      ASSERT_EQ(run.report().phase, expected.phase);
      deepest_m = std::max(deepest_m, run.report().insertion_m);
    }
  EXPECT_GT(deepest_m, 0.01) << "the gesture goes somewhere";
}

// paths that were found before are those that the engine finds itself, in the first gesture and in the next
TEST(TickRun, inABodyStepsOnItsPathsAsTheEngineDoes) {
  const SceneSpec scene = sceneIn(slabOfTissue());
  const SceneModel model = *compile(scene, 1000);
  const auto gesture = measuringGesture(scene, 1000);
  TickRun run(model, gesture);
  for (int round = 0; round < 2; ++round) {
    SceneEngine engine(model);
    StepReport expected;
    double greatest_N = 0;
    for (std::size_t k = 0; k < gesture.size(); ++k) {
      engine.step(gesture[k], expected);
      run.tick();
      ASSERT_EQ(run.report().wrench_W.force_N.z, expected.wrench_W.force_N.z) << round << ", tick " << k;
      ASSERT_EQ(run.report().flags, expected.flags);
      greatest_N = std::max(greatest_N, norm(expected.wrench_W.force_N));
    }
    EXPECT_GT(greatest_N, 0.1) << "the model of the body alone has no force";
  }
}

TEST(TickRun, hasTheCapOnWhereItIsAskedFor) {
  SceneSpec scene = allEffects();
  useUsualNumbers(effectEntry(Effect::kPalpation), scene);
  scene.effects = bitOf(Effect::kPalpation);
  const SceneModel model = *compile(scene, 1000);
  const auto gesture = measuringGesture(scene, 1000);
  for (const bool capped : {false, true}) {
    TickRun run(model, gesture, capped);
    for (std::size_t k = 0; k < gesture.size() / 2; ++k) run.tick();
    EXPECT_EQ((run.report().flags & kFlagCapped) != 0, capped);
    EXPECT_EQ(norm(run.report().wrench_W.force_N) > 0, capped) << "no other effect is live";
  }
}

}  // namespace
}  // namespace needlelab::test
