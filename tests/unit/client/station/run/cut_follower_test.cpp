// What the station tells viewers of old cuts is what its engine remembers.
#include "client/station/run/cut_follower.h"

#include <gtest/gtest.h>

#include <span>
#include <vector>

#include "common/haptics/cut_snapshot.h"
#include "common/haptics/effects/effect_entry.h"
#include "tests/support/motions.h"
#include "tests/support/scenes.h"

namespace needlelab::test {
namespace {

SceneSpec rememberingScene() {
  SceneSpec scene = allEffects();
  scene.effects |= bitOf(Effect::kCutMemory);
  useUsualNumbers(effectEntry(Effect::kCutMemory), scene);
  return scene;
}

GestureSample sampleAt(std::uint64_t tick, const TipSample& tip) {
  GestureSample sample;
  sample.tick = tick;
  sample.p_WT_m[0] = tip.p_WT_m.x, sample.p_WT_m[1] = tip.p_WT_m.y, sample.p_WT_m[2] = tip.p_WT_m.z;
  sample.q_WT[0] = tip.q_WT.x, sample.q_WT[1] = tip.q_WT.y;
  sample.q_WT[2] = tip.q_WT.z, sample.q_WT[3] = tip.q_WT.w;
  return sample;
}

TEST(CutFollower, tellsAtEachExitAndOnceASecondOutsideWhatTheEngineRemembers) {
  const auto model = std::make_unique<SceneModel>(*compile(rememberingScene(), 1000));
  const auto engine = std::make_unique<SimState>();
  CutFollower follower(*model);
  StepReport report;
  std::vector<GestureSample> piece;
  std::uint64_t tick = 0, told_at = 0;
  int exits = 0, seconds = 0;
  bool left = false;
  Motion motion = randomGesture(3, 1000, defaultSite());
  motion.insert(motion.end(), 3500, motion.back());  // at rest outside
  for (const TipSample& tip : joined(motion, randomGesture(4, 1000, defaultSite()))) {
    piece.push_back(sampleAt(tick, tip));
    // the gate refused this one, and a ruined pose stands in the sample
    if (tick % 50 == 7) {
      piece.back().flags = kFlagNotStepped;
      piece.back().p_WT_m[2] += 0.01;
    } else {
      step(*model, tip, *engine, report);
      left = left || (report.flags & kFlagExit) != 0;
    }
    ++tick;
    if (piece.size() < 20) continue;
    const Bytes bytes = follower.follow(piece);
    piece.clear();
    const bool due = told_at == 0 || tick - told_at >= 1000;
    ASSERT_EQ(!bytes.empty(), !engine->inside && (left || due)) << tick;
    if (!bytes.empty()) {
      ASSERT_EQ(bytes, encodeCuts({tick - 1, engine->cuts})) << tick;
      (left ? exits : seconds)++;
      told_at = tick;
    }
    left = false;
  }
  EXPECT_GT(exits, 1);
  EXPECT_GT(seconds, 2);
  EXPECT_GT(engine->cuts.count, 1u);
}

TEST(CutFollower, isSilentInASceneWithoutTheEffect) {
  const auto model = std::make_unique<SceneModel>(*compile(allEffects(), 1000));
  CutFollower follower(*model);
  const std::vector<GestureSample> samples(2000);
  EXPECT_TRUE(follower.follow(samples).empty());
  EXPECT_TRUE(follower.follow({}).empty());
}

}  // namespace
}  // namespace needlelab::test
