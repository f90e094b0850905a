// An effect that a scene does not call for costs at most 1 % of the tick (DESIGN §5): instructions, counted
// by callgrind, of the engine's tick and of the same engine with that effect's code taken out of its sources
// (variant.cmake). Time would be too noisy to show 1 %; a count is the same on every run of a binary.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>

#include "client/effect_cost/instruction_count.h"
#include "client/effect_cost/tick_run.h"
#include "common/haptics/models/axial_entry.h"
#include "tests/support/sanitized.h"
#include "tests/support/scenes.h"

namespace needlelab {

extern const AxialEntry kEntry_without_cutting, kEntry_without_attracted, kEntry_without_wall,
    kEntry_without_clamping, kEntry_without_orientation_limit, kEntry_without_shaft_friction,
    kEntry_without_puncture, kEntry_run_time_masks;

namespace test {
namespace {

constexpr double kRateHz = 250;
constexpr double kMost = 0.01;  // share of the tick

// an engine, and which sets of live effects it can do
struct Engine {
  const char* name;
  const AxialEntry* entry;
  EffectMask cannot;
};

constexpr EffectMask kWall = bitOf(Effect::kCutting) | bitOf(Effect::kAttracted);

const Engine kWhole = {"the engine", &kTrackingWallEntry, 0};
const Engine kRunTimeMasks = {"effects asked for at run time", &kEntry_run_time_masks, 0};
const Engine kWithout[] = {
    {"CUTTING", &kEntry_without_cutting, bitOf(Effect::kCutting)},
    {"ATTRACTED", &kEntry_without_attracted, bitOf(Effect::kAttracted)},
    {"CUTTING and ATTRACTED", &kEntry_without_wall, kWall},
    {"CLAMPING", &kEntry_without_clamping, bitOf(Effect::kClamping)},
    {"ORIENTATION_LIMIT", &kEntry_without_orientation_limit, bitOf(Effect::kOrientationLimit)},
    {"SHAFT_FRICTION", &kEntry_without_shaft_friction, bitOf(Effect::kShaftFriction)},
    {"PUNCTURE", &kEntry_without_puncture, bitOf(Effect::kPuncture)},
};

// a count to be made: this engine with these live effects
struct Part {
  const Engine* engine;
  EffectMask live;
};

std::vector<Part> allParts() {
  std::vector<Part> parts;
  for (EffectMask live = 0; live <= kAllEffects; ++live) {
    parts.push_back({&kWhole, live});
    parts.push_back({&kRunTimeMasks, live});
    for (const Engine& engine : kWithout)
      if ((live & engine.cannot) == 0) parts.push_back({&engine, live});
  }
  return parts;
}

SceneModel modelOf(const Part& part) {
  SceneModel model = *compile(withEffects(allEffects(), part.live), kRateHz);
  model.step_function = (*part.engine->entry->steps)[part.live];
  return model;
}

// the counted program: each part once through the gesture
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

// why instructions cannot be counted here, or nothing
const char* whyNot() {
#ifdef NEEDLELAB_SANITIZED
  return "a sanitizer's own instructions would be counted, and valgrind cannot run it";
#elif !defined(__OPTIMIZE__)
  return "not an optimised build: its instructions say nothing";
#else
  return hasValgrind() ? nullptr : "valgrind is not on the PATH (Debian: valgrind)";
#endif
}

class Instructions : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    if (whyNot() != nullptr || !counts().empty()) return;
    const auto parts = allParts();
    const auto counted = countStepInstructions({ownProgram(), "--run-parts"}, parts.size());
    ASSERT_TRUE(counted.ok()) << counted.error().message;
    const auto ticks = static_cast<double>(measuringGesture(allEffects(), kRateHz).size());
    for (std::size_t i = 0; i < parts.size(); ++i)
      counts()[{parts[i].engine, parts[i].live}] = static_cast<double>((*counted)[i]) / ticks;
  }
  void SetUp() override {
    if (const char* reason = whyNot()) GTEST_SKIP() << reason;
  }
  using Counts = std::map<std::pair<const Engine*, EffectMask>, double>;
  static Counts& counts() {
    static Counts per_tick;
    return per_tick;
  }
  static double of(const Engine& engine, EffectMask live) { return counts().at({&engine, live}); }
};

TEST_F(Instructions, anEffectThatIsNotLiveCostsAtMostOnePercentOfTheTick) {
  double worst = 0;
  for (const Engine& engine : kWithout)
    for (EffectMask live = 0; live <= kAllEffects; ++live) {
      if ((live & engine.cannot) != 0) continue;
      const double with_code = of(kWhole, live), without_code = of(engine, live);
      EXPECT_GT(without_code, 50) << "something was counted";
      EXPECT_LE(with_code, without_code * (1 + kMost)) << engine.name << " is not live in set " << live
                                                       << ": " << with_code << " against " << without_code;
      worst = std::max(worst, with_code / without_code - 1);
    }
  RecordProperty("worst_share", std::to_string(worst));
  std::printf("worst: %.3f %% of the tick\n", worst * 100);
}

TEST_F(Instructions, aMaskAskedForAtRunTimeWouldBeSeen) {
  double least = 1;
  for (EffectMask live = 0; live <= kAllEffects; ++live) {
    const double more = of(kRunTimeMasks, live) / of(kWhole, live) - 1;
    EXPECT_GT(more, kMost) << "set " << live;
    least = std::min(least, more);
  }
  std::printf("at least %.1f %% more\n", least * 100);
}

TEST_F(Instructions, theEnginesWithoutAnEffectGiveTheSameBits) {
  const auto gesture = measuringGesture(allEffects(), kRateHz);
  for (const Part& part : allParts()) {
    const SceneModel whole = modelOf({&kWhole, part.live}), other = modelOf(part);
    const auto state = std::make_unique<SimState>(), other_state = std::make_unique<SimState>();
    for (const TipSample& sample : gesture) {
      StepReport a, b;
      step(whole, sample, *state, a);
      step(other, sample, *other_state, b);
      ASSERT_EQ(a.wrench_W, b.wrench_W) << part.engine->name << ", set " << part.live;
      ASSERT_EQ(a.flags, b.flags) << part.engine->name << ", set " << part.live;
    }
  }
}

TEST_F(Instructions, thePapersTickStaysWithinItsGoal) {
  constexpr EffectMask kPaper = kWall | bitOf(Effect::kClamping) | bitOf(Effect::kOrientationLimit);
  EXPECT_LE(of(kWhole, kPaper), 320) << "DESIGN §12";
  std::printf("the paper's four effects: %.1f instructions a tick; none %.1f, all six %.1f\n",
              of(kWhole, kPaper), of(kWhole, 0), of(kWhole, kAllEffects));
}

TEST_F(Instructions, countsAreTheSameOnEveryRun) {
  const auto again = countStepInstructions({ownProgram(), "--run-parts"}, 2);
  ASSERT_TRUE(again.ok()) << again.error().message;
  const auto ticks = static_cast<double>(measuringGesture(allEffects(), kRateHz).size());
  EXPECT_EQ(static_cast<double>((*again)[0]) / ticks, of(kWhole, 0));
}

}  // namespace
}  // namespace test
}  // namespace needlelab

// under callgrind the program only runs the parts
int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "--run-parts") == 0) return needlelab::test::runParts();
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
