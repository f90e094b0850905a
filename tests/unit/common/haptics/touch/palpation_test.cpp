/// PALPATION: a capped needle on skin and bone, and the cap. Hard cases have a control that the check can
/// fail.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "common/haptics/body/body_engine.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/soft_tissue.h"
#include "tests/support/anatomy/bodies.h"
#include "tests/support/realtime/no_alloc.h"
#include "tests/unit/common/haptics/runs.h"

namespace needlelab::test {
namespace {

constexpr double kSkin_N_per_m = 300, kBone_N_per_m = 600, kFriction = 0.3, kRadius_m = 0.003;
constexpr double kT_s = 1 / kRate_hz;

SceneSpec palpable(SceneSpec spec, double friction = kFriction) {
  spec.effects |= bitOf(Effect::kPalpation);
  StageNumbers& numbers = spec.stage_numbers[stageOf(Effect::kPalpation)];
  numbers[kPalpationSkin_N_per_m] = kSkin_N_per_m;
  numbers[kPalpationBone_N_per_m] = kBone_N_per_m;
  numbers[kPalpationFriction] = friction;
  numbers[kPalpationRadius_m] = kRadius_m;
  spec.max_force_N = 50;
  return spec;
}

/// A finger along x, its top at z = 0: tissue of 8 mm over a bone of 12 mm.
FieldSpec finger() {
  FieldSpec spec = arm();
  spec.groups = {{"skin", {capsule(mm(-200, 0, -20), mm(200, 0, -20), 20, 20)}},
                 {"bone", {capsule(mm(-200, 0, -20), mm(200, 0, -20), 12, 12)}}};
  return spec;
}

/// Flat tissue over a bone that ends at x = 0: a rod of 4 mm along y, its top 6 mm below the skin, and
/// thinner than the tip presses.
FieldSpec rod() {
  FieldSpec spec = arm();
  spec.groups = {{"skin", {halfSpace({}, {0, 0, 1})}},
                 {"bone", {capsule(mm(0, -200, -8), mm(0, 200, -8), 2, 2)}}};
  return spec;
}

struct CappedRun {
  std::vector<Vec3> tips;
  std::vector<StepReport> reports;

  [[nodiscard]] Vec3 force(std::size_t i) const { return reports[i].wrench_W.force_N; }
  /// How much more than its bound the force steps in any tick. Bound: each spring's stretch changes by no
  /// more than √(2 + μ²) times the way, and by the fall over an edge (proxy_contact.h).
  [[nodiscard]] double stepBeyondBound_N(const std::function<Vec3(std::size_t)>& force) const {
    constexpr double kFall_m = 0.020 * kT_s;
    double most = -1;
    for (std::size_t i = 1; i < tips.size(); ++i) {
      const double way_m = norm(tips[i] - tips[i - 1]);
      const double bound = kSkin_N_per_m * (std::sqrt(2 + kFriction * kFriction) * way_m + kFall_m) +
                           kBone_N_per_m * (std::sqrt(2.0) * way_m + kFall_m);
      most = std::max(most, norm(force(i) - force(i - 1)) - bound);
    }
    return most;
  }
  [[nodiscard]] double stepBeyondBound_N() const {
    return stepBeyondBound_N([this](std::size_t i) { return force(i); });
  }
  [[nodiscard]] int ticksWith(std::uint32_t flag) const {
    return static_cast<int>(
        std::ranges::count_if(reports, [&](const StepReport& report) { return (report.flags & flag) != 0; }));
  }
};

/// A hand that points straight down.
class DownHand {
 public:
  explicit DownHand(const SceneSpec& spec, Vec3 start)
      : model_(std::make_unique<SceneModel>(compiled(spec, kRate_hz))), engine_(*model_), at_(start) {
    engine_.wantCap(true);
    rest(5);
  }
  DownHand& to(Vec3 place, double speed_mps) {
    const Vec3 from = at_;
    const int ticks = std::max(1, static_cast<int>(std::ceil(norm(place - from) / speed_mps * kRate_hz)));
    for (int k = 1; k <= ticks; ++k) step(from + (place - from) * (k / static_cast<double>(ticks)));
    return *this;
  }
  DownHand& rest(int ticks) {
    for (int k = 0; k < ticks; ++k) step(at_);
    return *this;
  }
  DownHand& cap(bool on) {
    engine_.wantCap(on);
    return *this;
  }
  [[nodiscard]] const CappedRun& run() const { return run_; }
  [[nodiscard]] Vec3 force() const { return run_.force(run_.reports.size() - 1); }
  [[nodiscard]] SceneEngine& engine() { return engine_; }

 private:
  void step(Vec3 place) {
    at_ = place;
    engine_.step({at_, leaning(0)}, run_.reports.emplace_back());
    EXPECT_TRUE(isFinite(force()));
    run_.tips.push_back(at_);
  }
  std::unique_ptr<SceneModel> model_;
  SceneEngine engine_;
  Vec3 at_;
  CappedRun run_;
};

TEST(Palpation, skinPushesBackByTheDepthOfTheBall) {
  for (const SceneSpec& spec : {sceneIn(slabOfTissue()), slabAsShells(sceneIn(slabOfTissue()))}) {
    DownHand hand(palpable(spec), {0, 0, 0.01});
    hand.to({0, 0, -0.005}, 0.02);
    const CappedRun& run = hand.run();
    for (std::size_t i = 0; i < run.tips.size(); ++i) {
      EXPECT_NEAR(run.force(i).z, kSkin_N_per_m * std::max(0.0, kRadius_m - run.tips[i].z), 1e-4) << i;
      EXPECT_NEAR(std::hypot(run.force(i).x, run.force(i).y), 0, 1e-4);
      EXPECT_EQ(run.reports[i].layer, -1);
    }
    EXPECT_EQ(run.ticksWith(kFlagEntry), 0);
  }
}

TEST(Palpation, boneUnderTissueAddsItsSpring) {
  SceneSpec shells = slabAsShells(sceneIn(slabOfTissue()));
  shells.layers.resize(2);
  shells.layers[0].membrane.reset();
  shells.layers[0].thickness_m = 0.008;
  shells.layers[1] = boneTissue();
  for (const SceneSpec& spec : {sceneIn(finger()), shells}) {
    DownHand hand(palpable(spec), {0, 0, 0.01});
    hand.to({0, 0, -0.010}, 0.02);
    const CappedRun& run = hand.run();
    for (std::size_t i = 0; i < run.tips.size(); ++i) {
      const double pressed_m = kRadius_m - run.tips[i].z;
      EXPECT_NEAR(run.force(i).z,
                  kSkin_N_per_m * std::max(0.0, pressed_m) + kBone_N_per_m * std::max(0.0, pressed_m - 0.008),
                  2e-3)
          << i;
    }
    EXPECT_GT(run.force(run.tips.size() - 1).z, 6);
  }
}

TEST(Palpation, slidingDragsTheSkinUpToTheFrictionCone) {
  DownHand hand(palpable(sceneIn(slabOfTissue())), {0, 0, 0.01});
  hand.to({0, 0, -0.003}, 0.02).to({0.0005, 0, -0.003}, 0.02);
  EXPECT_NEAR(hand.force().x, -kSkin_N_per_m * 0.0005, 1e-6) << "it sticks";
  hand.to({0.03, 0, -0.003}, 0.05);
  EXPECT_NEAR(hand.force().x, -kFriction * kSkin_N_per_m * 0.006, 1e-4) << "it slips";
  EXPECT_NEAR(hand.force().z, kSkin_N_per_m * 0.006, 1e-4);
}

/// A smooth gesture over the finger and back, drawn by seed.
std::vector<Vec3> gestureOverTheFinger(std::uint32_t seed) {
  const auto phase = [&](std::uint32_t i) { return 0.7 * static_cast<double>((seed * 7 + i * 13) % 9); };
  std::vector<Vec3> tips;
  constexpr int kTicks = 8000;
  for (int k = 0; k < kTicks; ++k) {
    const double t = k * kT_s, share = std::sin(std::numbers::pi * k / (kTicks - 1));
    const double across_m = 0.012 * share * std::sin(2.1 * t + phase(0));
    const double along_m = 0.03 * share * std::sin(1.3 * t + phase(1));
    const double depth_m = share * (0.006 + 0.005 * std::sin(3.7 * t + phase(2)));
    tips.push_back({along_m, across_m, 0.012 * (1 - share) - depth_m});
  }
  return tips;
}

/// The least of what the hand has put in so far, in J: below 0 it got more than it gave.
double leastGiven_J(const std::vector<Vec3>& tips, const std::vector<Vec3>& forces) {
  double given_J = 0, least_J = 0;
  for (std::size_t i = 1; i < tips.size(); ++i) {
    given_J -= 0.5 * dot(forces[i] + forces[i - 1], tips[i] - tips[i - 1]);
    least_J = std::min(least_J, given_J);
  }
  return least_J;
}

TEST(Palpation, aHandNeverGetsMoreEnergyThanItGave) {
  for (const double friction : {0.0, kFriction}) {
    for (std::uint32_t seed = 0; seed < 20; ++seed) {
      const auto model =
          std::make_unique<SceneModel>(compiled(palpable(sceneIn(finger()), friction), kRate_hz));
      SceneEngine engine(*model);
      engine.wantCap(true);
      const std::vector<Vec3> tips = gestureOverTheFinger(seed);
      std::vector<Vec3> forces, swirling;
      StepReport report;
      for (const Vec3 tip : tips) {
        engine.step({tip, leaning(0)}, report);
        forces.push_back(report.wrench_W.force_N);
        swirling.push_back(forces.back() + Vec3{-tip.y, tip.x, 0} * (friction > 0 ? 60.0 : 20.0));
      }
      EXPECT_GT(leastGiven_J(tips, forces), -2e-6) << seed;
      if (seed == 0) EXPECT_LT(leastGiven_J(tips, swirling), -2e-6) << "control: a force that swirls";
    }
  }
}

// The tip, pressed deeper than the rod is thick, slides over it and off at its edge: no step beyond the
// bound. Control: a spring to the nearest surface of the bone turns over in the rod's middle.
TEST(Palpation, theForceOverABonesEdgeDoesNotStep) {
  DownHand hand(palpable(sceneIn(rod())), {-0.02, 0, 0.01});
  hand.to({-0.02, 0, -0.0085}, 0.02).to({0.02, 0, -0.0085}, 0.1).to({-0.02, 0, -0.0085}, 0.1);
  hand.to({0, 0, 0.01}, 0.1).to({0, 0, -0.0085}, 0.05).to({0.02, 0, -0.0085}, 0.05);
  const CappedRun& run = hand.run();
  EXPECT_LT(run.stepBeyondBound_N(), 1e-6);
  double most_N = 0;
  for (std::size_t i = 0; i < run.tips.size(); ++i) most_N = std::max(most_N, run.force(i).z);
  EXPECT_GT(most_N, kSkin_N_per_m * 0.0115 + kBone_N_per_m * 0.004) << "the rod is felt";
  EXPECT_GT(run.stepBeyondBound_N([&](std::size_t i) {
    const Vec3 off{run.tips[i].x, 0, run.tips[i].z + 0.008};
    const double away_m = norm(off);
    return off * (kBone_N_per_m * std::max(0.0, 0.002 + kRadius_m - away_m) / away_m);
  }),
            0.1);
}

TEST(Palpation, aCapComesOffOnlyClearOfTheSkin) {
  DownHand hand(palpable(sceneIn(finger())), {0, 0, 0.01});
  hand.to({0, 0, -0.006}, 0.02);
  const Vec3 loaded = hand.force();
  EXPECT_GT(norm(loaded), 2);
  hand.cap(false).rest(200);
  EXPECT_EQ(hand.force(), loaded) << "under load it stays on";
  hand.to({0, 0, 0.006}, 0.02);
  const CappedRun lifted = hand.run();
  EXPECT_LT(lifted.stepBeyondBound_N(), 1e-6);
  const auto touches = [](Vec3 tip) { return tip.z < kRadius_m - 1e-9; };
  const auto last = std::find_if(lifted.tips.rbegin(), lifted.tips.rend(), touches).base();
  const auto capped_ticks = static_cast<std::size_t>(last - lifted.tips.begin());
  for (std::size_t i = 0; i < lifted.tips.size(); ++i)
    if (i != capped_ticks && i != capped_ticks + 1)  // there the ball just lets go of the skin
      EXPECT_EQ((lifted.reports[i].flags & kFlagCapped) != 0, i < capped_ticks) << i;
  EXPECT_EQ(lifted.ticksWith(kFlagEntry), 0);
  hand.rest(50).to({0, 0, -0.004}, 0.02);
  EXPECT_EQ(hand.run().ticksWith(kFlagEntry), 1) << "then it is a needle";
  hand.cap(true).rest(20);
  EXPECT_FALSE(hand.engine().isCapped()) << "in tissue the cap does not go on";
  hand.to({0, 0, 0.01}, 0.02).rest(2);
  EXPECT_TRUE(hand.engine().isCapped());
}

// Its derivatives by differences, also across x = 1 and without bone.
TEST(SoftTissue, forceAndPushAreTheSlopesOfItsEnergy) {
  const SoftTissue tissue{105, 300};
  constexpr double kStep_m = 1e-6;
  for (const double cover_m : {0.0005, 0.004, 0.015, 1.0})
    for (double stretch_m = 0.0003; stretch_m < 0.02; stretch_m += 0.00031) {
      const auto now = tissue.at(stretch_m, cover_m);
      const auto energy_J = [&](double s, double t) { return tissue.at(s, t).energy_J; };
      EXPECT_NEAR((energy_J(stretch_m + kStep_m, cover_m) - energy_J(stretch_m - kStep_m, cover_m)) / 2e-6,
                  now.force_N, 1e-6);
      EXPECT_NEAR((energy_J(stretch_m, cover_m + kStep_m) - energy_J(stretch_m, cover_m - kStep_m)) / 2e-6,
                  now.per_cover_N, 1e-6);
      EXPECT_NEAR((tissue.at(stretch_m, cover_m + kStep_m).per_cover_N -
                   tissue.at(stretch_m, cover_m - kStep_m).per_cover_N) /
                      2e-6,
                  now.bend_N_per_m, std::fabs(stretch_m - cover_m) < 1e-5 ? 300 : 1);
    }
  EXPECT_NEAR(tissue.at(0.01, 0.01).force_N, 0.01 * (105 + 300 / 5.0), 1e-12) << "where bone is met";
  EXPECT_NEAR(tissue.at(0.01, std::numeric_limits<double>::infinity()).force_N, 1.05, 1e-12);
}

// The work of a press is what the springs are said to hold, and stiffening adds to it.
TEST(Palpation, thePressesWorkIsHeld) {
  SceneSpec scene = palpable(sceneIn(finger()));
  scene.stage_numbers[stageOf(Effect::kPalpation)][kPalpationStiffening] = 0.5;
  DownHand hand(scene, {0, 0, 0.01});
  hand.to({0, 0, -0.009}, 0.02);
  const CappedRun& run = hand.run();
  double work_J = 0;
  for (std::size_t i = 1; i < run.tips.size(); ++i)
    work_J += 0.5 * (run.force(i).z + run.force(i - 1).z) * (run.tips[i - 1].z - run.tips[i].z);
  const double held_J = heldEnergy_J(hand.engine().model(), hand.engine().state(), run.reports.back());
  EXPECT_NEAR(held_J, work_J, 1e-5);
  EXPECT_GT(held_J, 0.5 * kSkin_N_per_m * 0.012 * 0.012);
}

// Until the needle's first path comes, the plane of the last piece tells how far the tip is off the skin.
TEST(Palpation, aNeedleWhoseCapCameOffKnowsHowFarTheSkinIs) {
  DownHand hand(palpable(sceneIn(finger())), {0, 0, 0.03});
  hand.to({0, 0, -0.004}, 0.02).to({0, 0, 0.02}, 0.05).cap(false).rest(60);
  const CappedRun& run = hand.run();
  std::size_t off = 0;
  for (std::size_t i = 400; i < run.reports.size(); ++i) {
    if ((run.reports[i].flags & kFlagCapped) != 0) continue;
    ++off;
    EXPECT_NEAR(run.reports[i].depth_m, -0.02, 2e-4) << off;
    EXPECT_EQ(run.reports[i].flags & kFlagStartedInside, 0u) << off;
  }
  EXPECT_GE(off, 60u);
}

// Two fingers side by side, their skins blended over 8 mm: its field is no distance beside the valley.
// Contact begins without a step, and pulls nowhere in.
TEST(Palpation, contactBeginsSoftlyOnBlendedSkin) {
  FieldSpec field = finger();
  field.groups[0].parts = {capsule(mm(-200, -18, -20), mm(200, -18, -20), 20, 20),
                           capsule(mm(-200, 18, -20), mm(200, 18, -20), 20, 20, 8)};
  for (const double y_m : {0.0, 0.004, 0.008, 0.014}) {
    DownHand hand(palpable(sceneIn(field)), {0, y_m, 0.01});
    hand.to({0, y_m, -0.02}, 0.02);
    const CappedRun& run = hand.run();
    EXPECT_LT(run.stepBeyondBound_N(), 1e-6) << y_m;
    const auto touched = std::ranges::find_if(
        run.reports, [](const StepReport& report) { return norm(report.wrench_W.force_N) > 0; });
    ASSERT_NE(touched, run.reports.end());
    EXPECT_LT(norm(touched->wrench_W.force_N), kSkin_N_per_m * 2.1e-5) << "one tick at 20 mm/s deep";
    for (const StepReport& report : run.reports) EXPECT_GE(report.wrench_W.force_N.z, 0) << y_m;
  }
}

TEST(Palpation, boneOfShellsThatSlantsEndsAtTheSkin) {
  SceneSpec shells = slabAsShells(sceneIn(slabOfTissue()));
  shells.layers.resize(2);
  shells.layers[0].membrane.reset();
  shells.layers[0].thickness_m = 0.008;
  shells.layers[1] = boneTissue();
  shells.bone_normal = Vec3{-0.5, 0, std::sqrt(0.75)};  // it comes up towards +x: at the skin at 14 mm
  DownHand hand(palpable(shells), {0.03, 0, 0.01});
  hand.to({0.03, 0, kRadius_m + 1e-4}, 0.02);
  EXPECT_EQ(hand.force(), Vec3{}) << "no bone in the air";
  hand.to({0.03, 0, 0.001}, 0.02);
  EXPECT_NEAR(hand.force().z, (kSkin_N_per_m + kBone_N_per_m) * 0.002, 1e-6);
  hand.to({0.03, 0, 0.01}, 0.02).to({-0.01, 0, 0.01}, 0.05).to({-0.01, 0, -0.004}, 0.02);
  EXPECT_NEAR(hand.force().z, kSkin_N_per_m * 0.007, 1e-3) << "here it is 14 mm deep";
}

TEST(Palpation, theSumIsLimitedToTheScenesForce) {
  SceneSpec scene = palpable(sceneIn(finger()));
  scene.max_force_N = 2;
  DownHand hand(scene, {0, 0, 0.01});
  hand.to({0, 0, -0.01}, 0.02);
  EXPECT_NEAR(norm(hand.force()), 2, 1e-12);
  EXPECT_NEAR(effectEntry(Effect::kPalpation).value(hand.run().reports.back()),
              kSkin_N_per_m * 0.013 + kBone_N_per_m * 0.005, 2e-3)
      << "the term is not";
}

TEST(Palpation, withTheCapOffItsTermIsZero) {
  DownHand hand(palpable(sceneIn(finger())), {0, 0, 0.01});
  hand.to({0, 0, -0.004}, 0.02).to({0, 0, 0.01}, 0.02).cap(false).rest(30).to({0, 0, -0.004}, 0.02);
  EXPECT_GE(hand.run().reports.back().layer, 0);
  EXPECT_EQ(effectEntry(Effect::kPalpation).value(hand.run().reports.back()), 0);
}

TEST(Palpation, aCopyOfTheEngineGoesOnAlikeAndARestartHasNoCap) {
  const auto model = std::make_unique<SceneModel>(compiled(palpable(sceneIn(finger())), kRate_hz));
  SceneEngine one(*model), other(*model);
  one.wantCap(true);
  StepReport a, b;
  const auto at = [](int k) { return TipSample{{2e-5 * k, 0.003, 0.01 - 2e-5 * k}, leaning(0)}; };
  for (int k = 0; k < 700; ++k) one.step(at(k), a);
  EXPECT_GT(norm(a.wrench_W.force_N), 2);
  other.continueFrom(one);
  EXPECT_EQ(hashOf(other.state()), hashOf(one.state()));
  for (int k = 700; k < 900; ++k) {
    one.step(at(k), a);
    other.step(at(k), b);
    ASSERT_EQ(a.wrench_W.force_N, b.wrench_W.force_N);
  }
  other.restart();
  other.step(at(0), b);
  EXPECT_FALSE(other.isCapped());
}

TEST(Palpation, aSampleThatIsNotFiniteChangesNothing) {
  DownHand hand(palpable(sceneIn(finger())), {0, 0, 0.01});
  hand.to({0, 0, -0.004}, 0.02);
  const std::uint64_t before = hashOf(hand.engine().state());
  StepReport report;
  hand.engine().step({{0, 0, std::nan("")}, leaning(0)}, report);
  EXPECT_EQ(report.flags, kFlagNotStepped | kFlagCapped);
  EXPECT_EQ(report.wrench_W.force_N, Vec3{});
  EXPECT_EQ(hashOf(hand.engine().state()), before);
}

TEST(Palpation, aTipThatBeganInTheBodyFeelsNothing) {
  DownHand hand(palpable(sceneIn(finger())), {0, 0, -0.004});
  EXPECT_EQ(hand.force(), Vec3{});
  EXPECT_TRUE(hand.engine().isCapped()) << "and it enters nothing";
  hand.to({0, 0, 0.002}, 0.02).to({0, 0, -0.002}, 0.02);
  EXPECT_EQ(hand.force(), Vec3{}) << "the ball never was off the skin";
  hand.to({0, 0, 0.01}, 0.02).to({0, 0, 0}, 0.02);
  EXPECT_NEAR(hand.force().z, kSkin_N_per_m * kRadius_m, 1e-3);
  // after a FAULT it must come out first
  hand.engine().leaveTissue();
  hand.rest(1);
  EXPECT_EQ(hand.force(), Vec3{});
  hand.to({0, 0, 0.01}, 0.02).to({0, 0, 0}, 0.02);
  EXPECT_NEAR(hand.force().z, kSkin_N_per_m * kRadius_m, 1e-3);
}

TEST(Palpation, aReaderOfTheTicksHasTheSameForces) {
  DownHand hand(palpable(sceneIn(finger())), {0, 0.004, 0.01});
  hand.to({0, 0.004, -0.006}, 0.02).to({0.02, -0.006, -0.008}, 0.05).cap(false).to({0, 0, 0.01}, 0.03);
  hand.rest(40).to({0, 0, -0.01}, 0.02).to({0, 0, 0.01}, 0.02);
  const CappedRun& run = hand.run();
  const auto model = std::make_unique<SceneModel>(compiled(palpable(sceneIn(finger())), kRate_hz));
  SceneEngine whole(*model), late(*model);
  const auto pressed = static_cast<std::size_t>(
      std::ranges::find_if(run.tips, [](Vec3 tip) { return tip.z < -0.005; }) - run.tips.begin());
  for (std::size_t i = 0; i < run.tips.size(); ++i) {
    StoredTick stored;
    stored.force_W_N = run.force(i);
    stored.p_wall_W_m = run.reports[i].p_wall_W_m;
    stored.layer = run.reports[i].layer;
    stored.phase = run.reports[i].phase;
    stored.flags = run.reports[i].flags;
    const TipSample sample{run.tips[i], leaning(0)};
    StepReport report;
    EXPECT_FALSE(whole.stepAsStored(sample, stored, report).isReal()) << i;
    EXPECT_EQ(report.wrench_W.force_N, run.force(i)) << i;
    if (i < pressed) continue;
    late.stepAsStored(sample, stored, report);
    EXPECT_EQ(report.flags & kFlagCapped, stored.flags & kFlagCapped);
    if (!late.isCapped()) continue;
    // it does not know where on the skin the cap sticks
    const double cone_N = kFriction * kSkin_N_per_m * std::max(0.0, report.depth_m + kRadius_m);
    EXPECT_LE(norm(report.wrench_W.force_N - run.force(i)), 2 * cone_N + 1e-6) << i;
  }
}

/// Has one path, made beforehand, which the engine keeps to its end.
class OnePath final : public PathMaker {
 public:
  explicit OnePath(PathStack* made) : made_(made) {}
  void ask(const PathAsk& /*ask*/) noexcept override {}
  bool take(PathStack*& made) noexcept override {
    made = std::exchange(given_, true) ? nullptr : made_.get();
    return true;
  }
  void retire(PathStack* /*path*/) noexcept override {}

 private:
  std::unique_ptr<PathStack> made_;
  bool given_ = false;
};

// After a FAULT the station's ball feels nothing until it was off the skin: so does a reader's, which saw
// none.
TEST(Palpation, aReaderAfterAFaultFeelsNothingEither) {
  const auto model = std::make_unique<SceneModel>(compiled(palpable(sceneIn(finger())), kRate_hz));
  SceneEngine station(*model), reader(*model);
  station.wantCap(true);
  double most_N = 0;
  for (int k = 0; k < 1200; ++k) {
    if (k == 700) station.leaveTissue();
    const double down_m = 2e-5 * (k < 900 ? k : 1800 - k);
    const TipSample sample{{0, 0, 0.01 - down_m}, leaning(0)};
    StepReport own, read;
    station.step(sample, own);
    StoredTick stored;
    stored.force_W_N = own.wrench_W.force_N;
    stored.flags = own.flags;
    reader.stepAsStored(sample, stored, read);
    EXPECT_EQ(read.wrench_W.force_N, own.wrench_W.force_N) << k;
    most_N = std::max(most_N, norm(own.wrench_W.force_N));
    if (k >= 700) EXPECT_EQ(own.wrench_W.force_N, Vec3{}) << k;
  }
  EXPECT_GT(most_N, 2);
}

/// Counts what is asked of a body, and of its pieces what was not made in a maker's ask.
class CountedBody final : public Body {
 public:
  explicit CountedBody(const FieldSpec& field) : body_(fieldOf(field)) {}
  [[nodiscard]] double depth(Vec3 p_m) const noexcept override { return ++asked, body_.depth(p_m); }
  [[nodiscard]] Vec3 normal(Vec3 p_m) const noexcept override { return ++asked, body_.normal(p_m); }
  [[nodiscard]] StructureIndex structureAt(Vec3 p_m) const noexcept override {
    return ++asked, body_.structureAt(p_m);
  }
  [[nodiscard]] LayerStack layersAlong(Vec3 from_m, Vec3 axis, double reach_m, double min_layer_m,
                                       AtBone at_bone) const noexcept override {
    return ++asked, body_.layersAlong(from_m, axis, reach_m, min_layer_m, at_bone);
  }
  [[nodiscard]] std::shared_ptr<const Bones> bonesIn(Vec3 center_m, double radius_m) const override {
    return ++asked, body_.bonesIn(center_m, radius_m);
  }
  [[nodiscard]] std::shared_ptr<const Surroundings> around(Vec3 center_m, double radius_m) const override {
    return ++asked, body_.around(center_m, radius_m);
  }
  mutable int asked = 0;

 private:
  FieldBody body_;
};

/// Another thread's paths: what they ask the body is not the tick's.
class PathsOfAnother final : public PathMaker {
 public:
  PathsOfAnother(const SceneModel& model, const CountedBody& body) : paths_(model), body_(body) {}
  void ask(const PathAsk& ask) noexcept override {
    const int before = body_.asked;
    paths_.ask(ask);
    body_.asked = before;
  }
  bool take(PathStack*& made) noexcept override { return paths_.take(made); }
  void retire(PathStack* path) noexcept override { paths_.retire(path); }

 private:
  PathsInPlace paths_;
  const CountedBody& body_;
};

TEST(Palpation, aTickWithTheCapOnAsksNoBody) {
  const auto body = std::make_shared<CountedBody>(finger());
  SceneSpec spec = palpable(sceneIn(finger()));
  std::get<BodyLimb>(spec.limb).body = body;
  const auto model = std::make_unique<SceneModel>(compiled(spec, kRate_hz));
  PathsOfAnother paths(*model, *body);
  SceneEngine engine(*model, &paths);
  engine.wantCap(true);
  body->asked = 0;
  double most_N = 0;
  for (const Vec3 tip : gestureOverTheFinger(3)) {
    StepReport report;
    engine.step({tip, leaning(0)}, report);
    most_N = std::max(most_N, norm(report.wrench_W.force_N));
  }
  EXPECT_EQ(body->asked, 0);
  EXPECT_GT(most_N, 2);
}

TEST(Palpation, aTickUsesNoHeap) {
  const auto model = std::make_unique<SceneModel>(compiled(palpable(sceneIn(finger())), kRate_hz));
  // its bones are those of a path, which is made beforehand
  PathsInPlace paths(*model);
  PathStack* made = nullptr;
  paths.ask({.p_tip_W_m = {0, 0, 0.01}, .ball_radius_m = 0.03, .axis_W = zAxis(leaning(0))});
  ASSERT_TRUE(paths.take(made) && made != nullptr);
  OnePath one(made);
  SceneEngine engine(*model, &one);
  engine.wantCap(true);
  StepReport report;
  double most_N = 0;
  std::uint64_t calls = 0;
  {
    const NoAllocScope scope;
    for (int k = 0; k < 1000; ++k) {
      engine.step({{0, 1e-5 * k, 0.01 - 2e-5 * k}, leaning(0)}, report);
      most_N = std::max(most_N, norm(report.wrench_W.force_N));
    }
    calls = scope.calls();
  }
  EXPECT_EQ(calls, 0u);
  EXPECT_GT(most_N, 3);
}

}  // namespace
}  // namespace needlelab::test
