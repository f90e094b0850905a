// A replay of stored data is the same gesture, or reports that it is not: 500 random gestures, rounded as
// chunks round them, also near the thresholds that decide a stop or a rupture.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "client/view/model/gesture_replica.h"
#include "common/gesture/chunk.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/effects/resume.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "tests/support/random.h"
#include "tests/support/scenes/motions.h"
#include "tests/support/scenes/scenes.h"
#include "tests/support/scenes/stored_sample.h"

namespace needlelab::test {
namespace {

constexpr double kRateHz = 1000;
/// How far a replay may be off without reporting it.
constexpr double kTold_N = 0.02;

struct Gesture {
  std::shared_ptr<const SceneModel> model;
  Motion motion;
};

/// What the station rendered and what it stored.
struct Recorded {
  std::vector<StepReport> reports;
  std::vector<GestureSample> samples;
};

Recorded recorded(const SceneModel& model, const Motion& motion) {
  const auto state = std::make_unique<SimState>();
  Recorded all;
  std::vector<GestureSample> exact;
  for (std::size_t k = 0; k < motion.size(); ++k) {
    StepReport report;
    step(model, motion[k], *state, report);
    all.reports.push_back(report);
    exact.push_back(storedSample(k, motion[k], report));
  }
  for (std::size_t first = 0; first < exact.size(); first += 1000) {
    const std::size_t count = std::min<std::size_t>(1000, exact.size() - first);
    const auto stored =
        decodeChunk(encodeChunk(Resolution::standard(), std::span(exact).subspan(first, count)));
    EXPECT_TRUE(stored.ok());
    all.samples.insert(all.samples.end(), stored->begin(), stored->end());
  }
  return all;
}

/// Tick counts of several gestures.
struct Counted {
  std::size_t ticks = 0, inside = 0, approximate = 0;
  std::size_t untold = 0;  ///< off by more than kTold_N, but not marked approximate
  double worst_N = 0;      ///< of those not marked approximate
  std::string first_untold;
};

double largestDifference_N(const StepReport& a, const StepReport& b) {
  return std::max({norm(a.wrench_W.force_N - b.wrench_W.force_N), std::fabs(a.cutting_N - b.cutting_N),
                   std::fabs(a.attracted_N - b.attracted_N), std::fabs(a.friction_N - b.friction_N),
                   std::fabs(a.puncture_N - b.puncture_N), std::fabs(a.clamping_N - b.clamping_N)});
}

void count(const StepReport& rendered, const StepReport& replayed, bool approximate, std::size_t tick,
           Counted& counted) {
  ++counted.ticks;
  counted.inside += rendered.layer >= 0 ? 1u : 0u;
  counted.approximate += approximate ? 1u : 0u;
  if (approximate) return;
  const double difference_N = largestDifference_N(rendered, replayed);
  counted.worst_N = std::max(counted.worst_N, difference_N);
  const bool same =
      difference_N <= kTold_N && rendered.phase == replayed.phase && rendered.layer == replayed.layer;
  if (same) return;
  if (counted.untold++ == 0)
    counted.first_untold = "tick " + std::to_string(tick) + ": " + std::to_string(difference_N) + " N";
}

/// Each force by effect, the sum, phase and layer of a replay.
void replay(const Gesture& gesture, Counted& counted) {
  const Recorded all = recorded(*gesture.model, gesture.motion);
  GestureReplica replica(gesture.model);
  for (std::size_t k = 0; k < all.samples.size(); ++k) {
    const bool approximate = replica.feed(all.samples[k]).approximate;
    count(all.reports[k], replica.report(), approximate, k, counted);
  }
}

/// Runs the engine alone along the stored poses.
void stepAlone(const Gesture& gesture, Counted& counted) {
  const Recorded all = recorded(*gesture.model, gesture.motion);
  const auto state = std::make_unique<SimState>();
  StepReport report;
  for (std::size_t k = 0; k < all.samples.size(); ++k) {
    step(*gesture.model, tipOf(all.samples[k]), *state, report);
    count(all.reports[k], report, false, k, counted);
  }
}

SceneSpec remembering(SceneSpec scene) {
  scene.effects |= bitOf(Effect::kCutMemory);
  useUsualNumbers(effectEntry(Effect::kCutMemory), scene);
  return scene;
}

/// A ball of 20 mm, so that these gestures go right through it.
SceneSpec ballOf(SceneSpec scene) {
  scene.limb = SphereLimb{{0, 0, -0.02}, 0.02};
  return scene;
}

/// Ten scenes: every limb, laws of clamping and of stops, CUT_MEMORY, and sample profiles.
struct ReplayScene {
  SceneSpec spec;
  Site site;
};
ReplayScene sceneOf(std::uint64_t number) {
  const auto ofSample = [](const char* name) {
    return *sceneSpecOf(*loadProfile(std::string(NEEDLELAB_SAMPLES) + "/" + name + ".json"));
  };
  switch (number % 10) {
    case 0:
      return {allEffects(), defaultSite()};
    case 1:
      return {withClamping(allEffects(), ClampingMode::kConservative), defaultSite()};
    case 2:
      return {withStop(allEffects(), StopMode::kExponential), defaultSite()};
    case 3:
      return {remembering(allEffects()), defaultSite()};
    case 4:
      return {ofSample("shoulder-adult"), defaultSite()};
    case 5:
      return {ofSample("carpal-tunnel"), defaultSite()};
    case 8:
      return {withClamping(ballOf(allEffects()), ClampingMode::kConservative), defaultSite()};
    default: {
      const LimbKind kind = kLimbKinds[number % 4];
      return {withLimb(allEffects(), kind), siteOf(kind)};
    }
  }
}

/// Fast in by 4 mm, which arms a stop; then on at 1.5 to 5 mm/s (v_stop is 3 mm/s) with 10 to 60 µm of
/// tremor, a rest, and out.
Motion slowInsertion(std::uint64_t seed, const Site& site) {
  Random random(seed);
  const double tangent = random.in(0, 0.4), length_m = random.in(0.006, 0.015);
  const double speed_mps = random.in(0.0015, 0.005), hold_s = random.in(0, 1.2);
  const double tremor_m = random.in(10e-6, 60e-6);
  const Vec3 axis = tilted(site.inward, tangent, site.across_1);
  MotionBuilder builder(kRateHz, site.p_surface_m - axis * 0.002, axis);
  builder.slideTo(site.p_surface_m + axis * 0.004, 0.012)
      .slideTo(site.p_surface_m + axis * length_m, speed_mps)
      .hold(hold_s)
      .slideTo(site.p_surface_m - axis * 0.002, speed_mps);
  return withTremor(builder.take(), kRateHz, tremor_m, seed ^ 0x7Eull);
}

Gesture gestureOf(std::uint64_t seed) {
  const ReplayScene scene = sceneOf(seed / 3);
  auto model = compile(scene.spec, kRateHz);
  EXPECT_TRUE(model.ok());
  GestureRange range;
  range.legs = 5;
  range.tremor_m = seed % 3 == 1 ? 50e-6 : 0;
  return {std::make_shared<const SceneModel>(*std::move(model)),
          seed % 3 == 2 ? slowInsertion(seed, scene.site) : randomGesture(seed, kRateHz, scene.site, range)};
}

/// Like the gesture that revealed it: 3 mm/s, which is v_stop, with 30 µm of tremor, after a fast start.
Gesture atTheThreshold(std::uint64_t seed) {
  const ReplayScene scene = sceneOf(4);
  const Site& site = scene.site;
  MotionBuilder builder(kRateHz, site.p_surface_m - site.inward * 0.002, site.inward);
  builder.slideTo(site.p_surface_m + site.inward * 0.004, 0.012)
      .slideTo(site.p_surface_m + site.inward * 0.019, 0.003);
  return {std::make_shared<const SceneModel>(*compile(scene.spec, kRateHz)),
          withTremor(builder.take(), kRateHz, 30e-6, seed)};
}

TEST(ReplayedGestures, areTheSameGestureOrSayThatTheyAreNot) {
  Counted counted;
  for (std::uint64_t seed = 1; seed <= 500; ++seed) {
    replay(gestureOf(seed), counted);
    ASSERT_EQ(counted.untold, 0u) << "gesture " << seed << ", " << counted.first_untold;
  }
  EXPECT_GT(counted.inside, 1'000'000u);
  EXPECT_LT(static_cast<double>(counted.approximate), 1e-3 * static_cast<double>(counted.ticks));
  RecordProperty("ticks", std::to_string(counted.ticks));
  RecordProperty("approximate", std::to_string(counted.approximate));
  RecordProperty("worst_N", std::to_string(counted.worst_N));
}

TEST(ReplayedGestures, areTheSameAtTheThresholdOfAStop) {
  Counted counted;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    replay(atTheThreshold(seed), counted);
    ASSERT_EQ(counted.untold, 0u) << "gesture " << seed << ", " << counted.first_untold;
  }
  EXPECT_EQ(counted.approximate, 0u);
  EXPECT_LT(counted.worst_N, 0.005);
}

// control: these gestures are hard ones
TEST(ReplayedGestures, roundedPosesAloneAreOtherGestures) {
  int other = 0;
  std::size_t most_ticks = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Counted counted;
    stepAlone(atTheThreshold(seed), counted);
    other += counted.untold > 0 ? 1 : 0;
    most_ticks = std::max(most_ticks, counted.untold);
  }
  EXPECT_GE(other, 5);
  EXPECT_GT(most_ticks, 1000u);
  other = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    Counted counted;
    stepAlone(gestureOf(seed), counted);
    other += counted.untold > 0 ? 1 : 0;
  }
  EXPECT_GE(other, 6);
}

// the force after the gate is not the engine's, so nothing is compared
TEST(ReplayedGestures, aForceThatTheGateChangedIsNoDifference) {
  const Gesture gesture = gestureOf(4);
  Recorded all = recorded(*gesture.model, gesture.motion);
  GestureReplica replica(gesture.model), unaware(gesture.model);
  std::size_t told = 0, inside = 0;
  for (GestureSample& sample : all.samples) {
    for (double& force_N : sample.force_W_N) force_N *= 0.5;
    const bool felt = norm({sample.force_W_N[0], sample.force_W_N[1], sample.force_W_N[2]}) > 0.02;
    inside += felt ? 1u : 0u;
    told += unaware.feed(sample).approximate ? 1u : 0u;
    sample.flags |= kGateThermalLimited;
    ASSERT_FALSE(replica.feed(sample).approximate) << sample.tick;
  }
  EXPECT_GT(inside, 1000u);
  EXPECT_GE(told, inside) << "half of the force, and no reason";
}

// STATISTICAL draws another curve for each insertion: without the earlier ones the wall is still known
TEST(ReplayedGestures, theForcesAreThoseOfAnInsertionWhoseNumberIsNotKnown) {
  auto profile = *loadProfile(std::string(NEEDLELAB_SAMPLES) + "/shoulder-models.json");
  ASSERT_TRUE(chooseModel(profile, "STATISTICAL").ok());
  const Site site = defaultSite();
  const Motion one = insertHoldWithdraw(kRateHz, site, site.inward, site.inward, 0.02, 0.01, 0.5);
  const Gesture gesture{std::make_shared<const SceneModel>(*compile(*sceneSpecOf(profile), kRateHz)),
                        joined(one, one)};
  const Recorded all = recorded(*gesture.model, gesture.motion);
  GestureReplica replica(gesture.model);
  double curves_differ_N = 0;
  for (std::size_t k = one.size(); k < all.samples.size(); ++k) {
    ASSERT_FALSE(replica.feed(all.samples[k]).approximate) << k;
    ASSERT_LE(largestDifference_N(all.reports[k], replica.report()), kTold_N) << k;
    curves_differ_N = std::max(curves_differ_N,
                               std::fabs(all.reports[k].cutting_N - all.reports[k - one.size()].cutting_N));
  }
  EXPECT_GT(curves_differ_N, 0.1);
}

}  // namespace
}  // namespace needlelab::test
