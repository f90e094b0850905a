// A tick in a body costs little more than in shells with the same layers: instructions, counted by callgrind,
// of SceneEngine::step in a slab of tissue, against shells below a plane and around
// a sphere, as the shoulder's. Paths were made before: finding them is another thread's work.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numbers>

#include "client/effect_cost/found_paths.h"
#include "client/effect_cost/tick_cost.h"
#include "common/haptics/body/body_engine.h"
#include "tests/support/anatomy/bodies.h"
#include "tests/support/sanitized.h"

namespace needlelab::test {
namespace {

struct Gesture {
  const char* name;
  double most, most_of_sphere;  ///< what a body may cost more than shells below a plane, and around a sphere
  std::vector<TipSample> before, counted;
};

std::vector<TipSample> straight(Vec3 from, Vec3 to, double speed_mps) {
  const auto ticks = static_cast<int>(std::ceil(norm(to - from) / speed_mps * kRate_hz));
  std::vector<TipSample> motion;
  for (int k = 1; k <= ticks; ++k)
    motion.push_back({from + (to - from) * (k / static_cast<double>(ticks)), leaning(0.2)});
  return motion;
}

void append(std::vector<TipSample>& motion, const std::vector<TipSample>& more) {
  motion.insert(motion.end(), more.begin(), more.end());
}

/// A hand that holds still, but for its tremor of 20 µm.
std::vector<TipSample> held(Vec3 at, int ticks) {
  std::vector<TipSample> motion;
  for (int k = 0; k < ticks; ++k) {
    const double angle = 2 * std::numbers::pi * 9.7 * k / kRate_hz;
    motion.push_back({at + Vec3{2e-5 * std::sin(angle), 2e-5 * std::cos(angle), 0}, leaning(0.2)});
  }
  return motion;
}

std::vector<Gesture> gestures() {
  const Vec3 axis = zAxis(leaning(0.2));
  const Vec3 above = axis * -0.01, shallow = axis * 0.008, deep = axis * 0.022,
             beside = above + Vec3{0.03, 0, 0};
  std::vector<TipSample> in = held(above, 50);
  append(in, straight(above, shallow, 0.03));
  std::vector<TipSample> moving = straight(shallow, deep, 0.03);
  append(moving, straight(deep, shallow, 0.03));
  return {{"inside, held", 0.15, 0.10, in, held(shallow, 1000)},
          {"inside, at 30 mm/s", 0.17, 0.10, in, moving},
          {"outside, at 50 mm/s", 0.45, 0.25, held(above, 50), straight(above, beside, 0.05)}};
}

SceneSpec slab() {
  SceneSpec spec = sceneIn(slabOfTissue());
  spec.effects &= ~bitOf(Effect::kBone);
  return spec;
}

[[gnu::noinline]] void countedTicks(SceneEngine& engine, const std::vector<TipSample>& motion,
                                    StepReport& report) {
  for (const TipSample& sample : motion) {
    engine.step(sample, report);
    keep(report);
  }
}
[[gnu::noinline]] void otherTicks(SceneEngine& engine, const std::vector<TipSample>& motion,
                                  StepReport& report) {
  for (const TipSample& sample : motion) engine.step(sample, report);
}

SceneSpec sphereOfShells() {
  SceneSpec spec = slabAsShells(slab());
  spec.limb = SphereLimb{{0, 0, -0.04}, 0.04};
  return spec;
}

/// The counted program: each gesture, in both kinds of shells and in the body.
int runGestures() {
  const auto body = std::make_unique<SceneModel>(*compile(slab(), kRate_hz));
  const auto shells = std::make_unique<SceneModel>(*compile(slabAsShells(slab()), kRate_hz));
  const auto sphere = std::make_unique<SceneModel>(*compile(sphereOfShells(), kRate_hz));
  for (const Gesture& gesture : gestures()) {
    FoundPaths paths(*body);
    StepReport report;
    {
      SceneEngine first(*body, &paths);
      otherTicks(first, gesture.before, report);
      otherTicks(first, gesture.counted, report);
    }
    paths.rewind();
    SceneEngine in_shells(*shells), in_sphere(*sphere), in_body(*body, &paths);
    for (SceneEngine* engine : {&in_shells, &in_sphere, &in_body}) {
      otherTicks(*engine, gesture.before, report);
      countedTicks(*engine, gesture.counted, report);
      endCountedPart();
    }
  }
  return 0;
}

TEST(BodyInstructions, aTickInABodyCostsLittleMoreThanInShells) {
#ifdef NEEDLELAB_SANITIZED
  GTEST_SKIP() << "a sanitizer's own instructions would be counted, and valgrind cannot run it";
#elif !defined(__OPTIMIZE__)
  GTEST_SKIP() << "not an optimised build: its instructions say nothing";
#endif
  ASSERT_TRUE(hasValgrind()) << "valgrind is not on the PATH (Debian: valgrind): nothing was counted";
  const auto all = gestures();
  const auto counted = countInstructions({ownProgram(), "--run-gestures"}, 3 * all.size(), "*countedTicks*");
  ASSERT_TRUE(counted.ok()) << counted.error().message;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto ticks = static_cast<double>(all[i].counted.size());
    const auto of = [&](std::size_t kind) { return static_cast<double>((*counted)[3 * i + kind]) / ticks; };
    const double in_shells = of(0), in_sphere = of(1), in_body = of(2);
    EXPECT_GT(in_shells, 100) << "something was counted";
    EXPECT_LE(in_body, (1 + all[i].most) * in_shells) << all[i].name;
    EXPECT_LE(in_body, (1 + all[i].most_of_sphere) * in_sphere) << all[i].name;
    std::printf(
        "%s: %.1f instructions a tick in shells below a plane, %.1f around a sphere, %.1f in a body\n",
        all[i].name, in_shells, in_sphere, in_body);
  }
}

}  // namespace
}  // namespace needlelab::test

// Under callgrind the program only runs the gestures.
int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "--run-gestures") == 0) return needlelab::test::runGestures();
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
