// An effect that is not live costs nothing. Instructions, counted by callgrind, of the engine's tick are
// compared with the same tick compiled with a stub instead of one effect's code: at most 1 % more. Time
// would be too noisy to show 1 %; a count is the same on every run of a binary. The comparison proves itself:
// engines with 2 % planted into an effect that is not live must exceed that 1 %. And one more effect costs
// nothing: the engine with four dummies (dummy_effects_test) has exactly the same counts.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>

#include "client/effect_cost/tick_cost.h"
#include "common/haptics/axial_entry.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/effects/step_live.h"
#include "tests/support/sanitized.h"
#include "tests/support/scenes/scenes.h"

namespace needlelab::test {
namespace {

constexpr double kRateHz = 250;
constexpr double kMost = 0.01;  // share of the tick

// ---- an engine without the code of one effect: only the zeros of the report remain ----

template <bool kLive>
struct NoCutting {
  static_assert(!kLive);
  static double behind(double x_m, const WallStretch&) { return x_m; }
};
template <bool kLive>
struct NoAttracted {
  static_assert(!kLive);
  static double ahead(double x_m, double, const WallStretch&) { return x_m; }
};
template <bool kLive>
struct NoClamping {
  static_assert(!kLive);
  static void clear(StepReport& report) { report.clamping_N = report.clamping_stiffness_N_per_m = 0.0; }
};
template <bool kLive>
struct NoOrientationLimit {
  static_assert(!kLive);
  static double readPose(const TipSample& sample) { return dot(sample.q_WT, sample.q_WT); }
  static void apply(const SceneModel&, const SimState&, double, StepReport& report) {
    report.wrench_W.torque_Nm = {};
  }
};
template <bool kLive>
struct NoShaftFriction {
  static_assert(!kLive);
  static void clear(StepReport& report) { report.friction_N = 0.0; }
};
template <bool kLive>
struct NoPuncture {
  static_assert(!kLive);
  static void rememberPlace(const SceneModel&, const SimState&, bool) {}
  static double apply(const SceneModel&, const SimState&, const Tick&, bool, StepReport& report) {
    return report.puncture_N = 0.0;
  }
};

// ---- an engine with 2 % of the paper's tick planted into an effect when it is not live ----

template <template <bool> class Step>
struct Planted {
  template <bool kLive>
  struct At : Step<kLive> {
    [[gnu::always_inline]] At() {
      if constexpr (!kLive) asm volatile("nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop");
    }
  };
};

// one effect's code replaced by another's
template <template <bool> class Step>
struct WithCutting : EffectSteps {
  template <bool kLive>
  using Cutting = Step<kLive>;
};
template <template <bool> class Step>
struct WithAttracted : EffectSteps {
  template <bool kLive>
  using Attracted = Step<kLive>;
};
template <template <bool> class Step>
struct WithClamping : EffectSteps {
  template <bool kLive>
  using Clamping = Step<kLive>;
};
template <template <bool> class Step>
struct WithOrientationLimit : EffectSteps {
  template <bool kLive>
  using OrientationLimit = Step<kLive>;
};
template <template <bool> class Step>
struct WithShaftFriction : EffectSteps {
  template <bool kLive>
  using ShaftFriction = Step<kLive>;
};
template <template <bool> class Step>
struct WithPuncture : EffectSteps {
  template <bool kLive>
  using Puncture = Step<kLive>;
};

// the wall, only in sets without an effect
template <Effect kEffect>
struct WallWithout : LayeredWall {
  static constexpr EffectMask kReplaces = bitOf(kEffect);
};
template <Effect kEffect, class Steps>
constexpr StepTable kSteps = stepTable<WallWithout<kEffect>, Steps>();

// An engine, and the effect that must not be live in its sets.
struct Engine {
  const StepTable* steps;
  EffectMask cannot;
};

const Engine kWhole = {axialEntry(AxialModel::kEnhancedTrackingWall).steps, 0};

// Besides the engine itself: without the effect's code, and with a planted cost.
struct Pair {
  Effect effect;
  Engine without, planted;
};
template <Effect kEffect, class Without, class WithPlant>
constexpr Pair pairOf() {
  return {
      kEffect, {&kSteps<kEffect, Without>, bitOf(kEffect)}, {&kSteps<kEffect, WithPlant>, bitOf(kEffect)}};
}
const Pair kPairs[] = {
    pairOf<Effect::kCutting, WithCutting<NoCutting>, WithCutting<Planted<CuttingStep>::At>>(),
    pairOf<Effect::kAttracted, WithAttracted<NoAttracted>, WithAttracted<Planted<AttractedStep>::At>>(),
    pairOf<Effect::kClamping, WithClamping<NoClamping>, WithClamping<Planted<ClampingStep>::At>>(),
    pairOf<Effect::kOrientationLimit, WithOrientationLimit<NoOrientationLimit>,
           WithOrientationLimit<Planted<OrientationLimitStep>::At>>(),
    pairOf<Effect::kShaftFriction, WithShaftFriction<NoShaftFriction>,
           WithShaftFriction<Planted<ShaftFrictionStep>::At>>(),
    pairOf<Effect::kPuncture, WithPuncture<NoPuncture>, WithPuncture<Planted<PunctureStep>::At>>(),
};
static_assert(std::size(kPairs) == kPlacedEffectCount);

// A count to make: this engine with these live effects.
struct Part {
  const Engine* engine;
  EffectMask live;
};

std::vector<Part> allParts() {
  std::vector<Part> parts;
  for (EffectMask live = 0; live <= kPlacedEffects; ++live) {
    parts.push_back({&kWhole, live});
    for (const Pair& pair : kPairs)
      for (const Engine* engine : {&pair.without, &pair.planted})
        if ((live & engine->cannot) == 0) parts.push_back({engine, live});
  }
  return parts;
}

SceneModel modelOf(const Part& part) {
  SceneModel model = *compile(withEffects(allEffects(), part.live), kRateHz);
  model.step_function = (*part.engine->steps)[part.live];
  return model;
}

// The counted program: runs each part once through the gesture.
int runParts() {
  const auto gesture = measuringGesture(allEffects(), kRateHz);
  for (const Part& part : allParts()) {
    const SceneModel model = modelOf(part);
    TickRun run(model, gesture);
    for (std::size_t k = 0; k < gesture.size(); ++k) run.tick();
    endCountedPart();
  }
  return 0;
}

// Returns the reason why instructions cannot be counted here, or nothing. A missing valgrind is not a reason:
// deploy/packages.txt lists it.
const char* whyNot() {
#ifdef NEEDLELAB_SANITIZED
  return "a sanitizer's own instructions would be counted, and valgrind cannot run it";
#elif !defined(__OPTIMIZE__)
  return "not an optimised build: its instructions say nothing";
#else
  return nullptr;
#endif
}

class Instructions : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (whyNot() != nullptr || !counts().empty()) return;
    ASSERT_TRUE(hasValgrind()) << "valgrind is not on the PATH (Debian: valgrind): nothing was counted";
    const auto parts = allParts();
    const auto counted = countStepInstructions({ownProgram(), "--run-parts"}, parts.size());
    ASSERT_TRUE(counted.ok()) << counted.error().message;
    const auto ticks = static_cast<double>(measuringGesture(allEffects(), kRateHz).size());
    for (std::size_t i = 0; i < parts.size(); ++i)
      counts()[{parts[i].engine, parts[i].live}] = static_cast<double>((*counted)[i]) / ticks;
  }
  void SetUp() override {
    if (const char* reason = whyNot()) GTEST_SKIP() << reason;
    ASSERT_FALSE(counts().empty()) << "nothing was counted";
  }
  using Counts = std::map<std::pair<const Engine*, EffectMask>, double>;
  static Counts& counts() {
    static Counts per_tick;
    return per_tick;
  }
  static double of(const Engine& engine, EffectMask live) { return counts().at({&engine, live}); }

  // Returns the extra cost of `engine` over the engine without the effect's code, in each set without the
  // effect.
  struct Excess {
    EffectMask live;
    double share;
  };
  static std::vector<Excess> excessesOf(const Engine& engine, const Pair& pair) {
    std::vector<Excess> excesses;
    for (EffectMask live = 0; live <= kPlacedEffects; ++live) {
      if ((live & pair.without.cannot) != 0) continue;
      // If neither CUTTING nor ATTRACTED is live, the wall does not run at all.
      if ((live & LayeredWall::kRenders) == 0 && (pair.without.cannot & LayeredWall::kRenders) != 0) continue;
      const double without_code = of(pair.without, live);
      EXPECT_GT(without_code, 50) << "something was counted";
      excesses.push_back({live, of(engine, live) / without_code - 1});
    }
    return excesses;
  }
};

TEST_F(Instructions, anInactiveEffectCostsAtMostOnePercentOfTheTick) {
  double worst = 0;
  for (const Pair& pair : kPairs)
    for (const Excess& excess : excessesOf(kWhole, pair)) {
      EXPECT_LE(excess.share, kMost) << effectName(pair.effect) << " is not live in set " << excess.live;
      worst = std::max(worst, excess.share);
    }
  RecordProperty("worst_share", std::to_string(worst));
  std::printf("worst: %.3f %% of the tick\n", worst * 100);
}

// The compiler rearranges a tick with planted code; in a few sets this saves as much as was planted.
TEST_F(Instructions, twoPercentPlantedIntoAnEffectThatIsNotLiveAreNoticed) {
  for (const Pair& pair : kPairs) {
    const std::vector<Excess> excesses = excessesOf(pair.planted, pair);
    const auto noticed = std::count_if(excesses.begin(), excesses.end(),
                                       [](const Excess& excess) { return excess.share > kMost; });
    EXPECT_GE(static_cast<double>(noticed), 0.7 * static_cast<double>(excesses.size()))
        << effectName(pair.effect);
    std::printf("planted into %s: noticed in %td of %zu sets\n", std::string(effectName(pair.effect)).c_str(),
                noticed, excesses.size());
  }
}

TEST(InstructionEngines, giveTheSameBits) {
  const auto gesture = measuringGesture(allEffects(), kRateHz);
  for (const Part& part : allParts()) {
    const SceneModel whole = modelOf({&kWhole, part.live}), other = modelOf(part);
    const auto state = std::make_unique<SimState>(), other_state = std::make_unique<SimState>();
    for (const TipSample& sample : gesture) {
      StepReport a, b;
      step(whole, sample, *state, a);
      step(other, sample, *other_state, b);
      ASSERT_EQ(a.wrench_W, b.wrench_W) << "set " << part.live;
      ASSERT_EQ(a.flags, b.flags) << "set " << part.live;
    }
  }
}

TEST_F(Instructions, thePapersTickStaysWithinItsGoal) {
  constexpr EffectMask kPaper =
      LayeredWall::kRenders | bitOf(Effect::kClamping) | bitOf(Effect::kOrientationLimit);
  EXPECT_LE(of(kWhole, kPaper), 456) << "tests/bench/README.md";
  std::printf("the paper's four effects: %.1f instructions a tick; none %.1f, all six %.1f\n",
              of(kWhole, kPaper), of(kWhole, 0), of(kWhole, kPlacedEffects));
}

// The same engine compiled with four more effects, all of them stages, in scenes that do not list them.
TEST_F(Instructions, fourMoreEffectsCostNothingWhereTheyAreNotLive) {
  constexpr std::size_t kSets = kPlacedEffects + 1;
  const auto counted = countStepInstructions({NEEDLELAB_DUMMY_EFFECTS_TEST, "--run-sets"}, kSets + 1);
  ASSERT_TRUE(counted.ok()) << counted.error().message;
  const auto ticks = static_cast<double>(measuringGesture(allEffects(), kRateHz).size());
  const auto withDummies = [&](std::size_t part) { return static_cast<double>((*counted)[part]) / ticks; };
  for (EffectMask live = 0; live < kSets; ++live)
    // an insertion's first tick, built with a larger state, differs by a few instructions of its registers
    EXPECT_NEAR(withDummies(live), of(kWhole, live), 0.1) << "set " << live;
  EXPECT_GT(withDummies(kSets), of(kWhole, 0) + 10) << "the control: only the dummies are live";
  std::printf("none %.1f, none with four dummies that are not live %.1f, with the four live %.1f\n",
              of(kWhole, 0), withDummies(0), withDummies(kSets));
}

TEST_F(Instructions, countsAreTheSameOnEveryRun) {
  const auto again = countStepInstructions({ownProgram(), "--run-parts"}, 2);
  ASSERT_TRUE(again.ok()) << again.error().message;
  const auto ticks = static_cast<double>(measuringGesture(allEffects(), kRateHz).size());
  EXPECT_EQ(static_cast<double>((*again)[0]) / ticks, of(kWhole, 0));
}

}  // namespace
}  // namespace needlelab::test

// Under callgrind the program only runs the parts.
int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "--run-parts") == 0) return needlelab::test::runParts();
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
