#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "client/device/hand/hand.h"
#include "client/device/hand/hand_options.h"
#include "client/device/hand/simulated_device.h"

namespace needlelab {
namespace {

HandOptions steady() {
  HandOptions options;
  options.tremor_m = 0;
  return options;
}

TEST(Hand, pullsBySpringAndDamper) {
  const Pose there{{0.1, 0, 0}, {}};
  Hand hand(steady(), HandPlan(there).hold(1), {}, 1e-3);
  // 300 N/m over (2, −1, 0) mm, 3 N·s/m against 0.1 m/s
  const Wrench w = hand.pull({{{0.098, 0.001, 0}, {}}, {0, 0, 0.1}, {}});
  EXPECT_NEAR(w.force_N.x, 0.6, 1e-12);
  EXPECT_NEAR(w.force_N.y, -0.3, 1e-12);
  EXPECT_NEAR(w.force_N.z, -0.3, 1e-12);
  EXPECT_EQ(w.torque_Nm, Vec3{});
}

TEST(Hand, isStifferAlongTheNeedleWhenItIsBraced) {
  HandOptions options = steady();
  options.bracing_N_per_m = 700;
  const Vec3 axis = normalized(Vec3{0.6, 0, -0.8}), across{0, 1, 0};
  Hand hand(options, HandPlan({{0.1, 0, 0}, orientationAlong(axis)}).hold(1), {}, 1e-3);
  // 1 mm short along the needle, 1 mm beside it, moving along it at 10 mm/s: 1000 N/m and 3 + 2.8 N·s/m along
  const HandleState state{
      {Vec3{0.1, 0, 0} - axis * 0.001 - across * 0.001, orientationAlong(axis)}, axis * 0.01, {}};
  const Vec3 force = hand.pull(state).force_N;
  EXPECT_NEAR(dot(force, axis), 1000 * 0.001 - 5.8 * 0.01, 1e-12);
  EXPECT_NEAR(dot(force, across), 0.3, 1e-12);
  EXPECT_NEAR(dot(force, cross(axis, across)), 0, 1e-12);
}

TEST(Hand, turnsTheHandleBackTheShortWay) {
  Hand hand(steady(), HandPlan(Pose{}).hold(1), {}, 1e-3);
  for (const double sign : {1.0, -1.0}) {  // q and −q are the same rotation
    const double a = 0.2;
    const Quat q{std::sin(a / 2) * sign, 0, 0, std::cos(a / 2) * sign};
    const Wrench w = hand.pull({{{}, q}, {}, {0, 0.5, 0}});
    EXPECT_NEAR(w.torque_Nm.x, -2 * 2 * std::sin(a / 2), 1e-12);
    EXPECT_NEAR(w.torque_Nm.y, -0.05 * 0.5, 1e-12);
    EXPECT_NEAR(w.torque_Nm.z, 0, 1e-12);
  }
}

TEST(Hand, pursuesThePlanWithTheTipOfTheTool) {
  // a tool of 150 mm, bent by a quarter turn about x
  const Pose X_HT{{0, 0.02, 0.15}, {std::sqrt(0.5), 0, 0, std::sqrt(0.5)}};
  const Pose start{{0.3, 0.1, 0.2}, orientationAlong({0.1, 0.2, -1})};
  const Pose deep{{0.3, 0.12, 0.1}, orientationAlong({0, 0.1, -1})};
  const HandPlan plan = HandPlan(start).moveTo(deep, 0.05, Motion::kMinJerk);
  Hand hand(steady(), plan, X_HT, 1e-3);
  EXPECT_LT(norm((hand.startPose() * X_HT).p - start.p), 1e-15);
  for (int k = 0; !hand.finished(); ++k) {
    hand.pull({});
    const Pose tip = hand.wanted() * X_HT, aim = plan.at(k * 1e-3).X_WT;
    ASSERT_LT(norm(tip.p - aim.p), 1e-12);
    ASSERT_GT(std::abs(dot(tip.q, aim.q)), 1 - 1e-12);
  }
}

TEST(Hand, letsGoAtItsTimeForGood) {
  HandOptions o;
  o.tremor_m = 0;
  o.release_s = 0.01;
  Hand hand(o, HandPlan(Pose{}).moveIn(Pose{{0.1, 0, 0}, {}}, 0.1, Motion::kLinear).hold(1), {}, 1e-3);
  const HandleState at_rest{};
  for (int step = 0; step < 200; ++step) {
    const Wrench pull = hand.pull(at_rest);
    if (step == 0) continue;  // starts at the handle's position
    EXPECT_EQ(norm(pull.force_N) > 0, step < 10) << "step " << step;
    EXPECT_NEAR(hand.wanted().p.x, std::min(0.1, 1e-3 * step), 1e-9);  // the plan continues
  }
}

TEST(Hand, doesItsPlanAsOftenAsAsked) {
  HandOptions options = steady();
  options.repeat = 3;
  const HandPlan plan =
      HandPlan(Pose{}).moveIn({{0, 0, 1}, {}}, 0.5, Motion::kLinear).moveIn({}, 0.5, Motion::kLinear);
  Hand hand(options, plan, {}, 1.0 / 1024);
  int steps = 0, tops = 0;
  for (double before = 0; !hand.finished(); ++steps) {
    hand.pull({});
    const double z = hand.wanted().p.z;
    if (before < 0.75 && z >= 0.75) ++tops;
    before = z;
  }
  EXPECT_EQ(steps, 3 * 1024);
  EXPECT_EQ(tops, 3);

  options.repeat = 0;
  Hand endless(options, plan, {}, 1.0 / 1024);
  for (int i = 0; i < 50 * 1024; ++i) endless.pull({});
  EXPECT_FALSE(endless.finished());
}

constexpr double kStep = 1.0 / 20'000;

TEST(HandRandom, isTheSameEverywhere) {
  // SplitMix64 with seed 1234567: the values of the published definition
  HandRandom random(1234567);
  EXPECT_EQ(random.next(), 6457827717110365317u);
  EXPECT_EQ(random.next(), 3203168211198807973u);
  EXPECT_EQ(random.next(), 9817491932198370423u);
  double least = 1, greatest = 0, sum = 0;
  for (int i = 0; i < 100'000; ++i) {
    const double u = random.uniform();
    least = std::min(least, u), greatest = std::max(greatest, u), sum += u;
  }
  EXPECT_GE(least, 0);
  EXPECT_LT(greatest, 1);
  EXPECT_NEAR(sum / 100'000, 0.5, 0.005);
}

TEST(HandTremor, staysWithinItsAmplitudeAndUsesIt) {
  for (const double amplitude : {25e-6, 50e-6, 250e-6}) {
    HandTremor tremor(amplitude, 7, kStep);
    double peak[3] = {0, 0, 0}, square = 0;
    const int n = 60 * 20'000;
    for (int i = 0; i < n; ++i) {
      const Vec3 d = tremor.next();
      peak[0] = std::max(peak[0], std::abs(d.x));
      peak[1] = std::max(peak[1], std::abs(d.y));
      peak[2] = std::max(peak[2], std::abs(d.z));
      square += normSquared(d);
    }
    for (const double p : peak) {
      EXPECT_LE(p, amplitude * (1 + 1e-9));
      EXPECT_GE(p, 0.9 * amplitude);
    }
    // three sines of a third of the amplitude in each of three axes: mean square A²/2 in all
    EXPECT_NEAR(square / n, amplitude * amplitude / 2, 0.02 * amplitude * amplitude);
  }
}

// After 10 minutes the phase of each sine matches its frequency: nothing drifts, nothing grows.
TEST(HandTremor, isTheSumOfSinesInTheBand) {
  const double amplitude = 1;
  HandTremor tremor(amplitude, 99, kStep);
  // fit the known frequencies to the first second and to the last: same amplitudes, a third each
  std::vector<double> x;
  const int n = 20'000 * 60;
  x.reserve(n);
  for (int i = 0; i < n; ++i) x.push_back(tremor.next().x);
  double explained = 0;
  for (std::size_t partial = 0; partial < HandTremor::kPartials; ++partial) {
    const double hz = tremor.frequencyHz(0, partial);
    EXPECT_GE(hz, 8);
    EXPECT_LE(hz, 12);
    double c = 0, s = 0;
    for (int i = 0; i < n; ++i) {
      const double a = 2 * M_PI * hz * i * kStep;
      c += x[static_cast<std::size_t>(i)] * std::cos(a);
      s += x[static_cast<std::size_t>(i)] * std::sin(a);
    }
    const double found = 2 * std::hypot(c, s) / n;
    EXPECT_NEAR(found, 1.0 / 3, 0.02);
    explained += found * found / 2;
  }
  double square = 0;
  for (const double v : x) square += v * v;
  EXPECT_NEAR(square / n, explained, 0.01);  // there are no other frequencies
}

TEST(HandTremor, dependsOnItsSeedOnly) {
  HandTremor a(50e-6, 1, kStep), b(50e-6, 1, kStep), c(50e-6, 2, kStep);
  std::uint64_t hash = 14695981039346656037u;
  bool differs = false;
  for (int i = 0; i < 20'000; ++i) {
    const Vec3 pa = a.next();
    EXPECT_EQ(pa, b.next());
    differs = differs || pa != c.next();
    for (const double v : {pa.x, pa.y, pa.z}) {
      std::uint64_t bits = 0;
      std::memcpy(&bits, &v, sizeof bits);
      hash = (hash ^ bits) * 1099511628211u;
    }
  }
  EXPECT_TRUE(differs);
  EXPECT_EQ(hash, 5944133999550495048u) << "the bits of a seed's hand have changed";
}

TEST(HandTremor, noAmplitudeMeansNoMotion) {
  HandTremor tremor(0, 1, kStep);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(tremor.next(), Vec3{});
}

// A steered hand on virtual time: its aim follows the steering commands and the hand follows its aim.

constexpr double kStep_s = 50e-6;
constexpr double kRate_hz = 1000;

struct SteeredRun {
  std::shared_ptr<HandSteering> steering = std::make_shared<HandSteering>();
  SteeredAim aim{steering, {{{0, 0, 0.03}, {}}, 0.1}, kStep_s};
  double peak_mps = 0, peak_radps = 0;
  HandAim now{{{0, 0, 0.03}, {}}, 0.1};

  void target(Vec3 p, Quat q = {}, double plunger = 0.1) { steering->setTarget({{p, q}, plunger}); }
  void go(double seconds) {
    for (double t = 0; t < seconds; t += kStep_s) {
      const HandAim next = aim.next();
      peak_mps = std::max(peak_mps, norm(next.X_WT.p - now.X_WT.p) / kStep_s);
      const Quat d = next.X_WT.q * conjugate(now.X_WT.q);
      peak_radps = std::max(peak_radps, 2 * norm(Vec3{d.x, d.y, d.z}) / kStep_s);
      now = next;
    }
  }
};

TEST(SteeredAim, withoutAWishItStaysWhereItBegan) {
  SteeredRun run;
  run.go(1);
  EXPECT_EQ(run.now.X_WT.p, (Vec3{0, 0, 0.03}));
  EXPECT_EQ(run.now.plunger, 0.1);
}

TEST(SteeredAim, aWishIsReachedWithoutOvershoot) {
  SteeredRun run;
  run.target({0, 0, 0.02});
  double lowest = 1;
  for (int i = 0; i < 40; ++i) {
    run.go(0.05);
    lowest = std::min(lowest, run.now.X_WT.p.z);
  }
  EXPECT_NEAR(run.now.X_WT.p.z, 0.02, 1e-8);
  EXPECT_GT(lowest, 0.02 - 1e-7);
}

TEST(SteeredAim, aTargetJumpIsFollowedAtTheSpeedLimit) {
  SteeredRun run;
  run.target({0.5, 0, 0.03});
  run.go(1);
  EXPECT_LE(run.peak_mps, kMaxAimSpeed_mps * (1 + 1e-9));
  EXPECT_GT(run.peak_mps, 0.99 * kMaxAimSpeed_mps);
  // acceleration costs the smoothing's 25 ms
  EXPECT_NEAR(run.now.X_WT.p.x, kMaxAimSpeed_mps * (1 - 0.025), 1e-4);
}

TEST(SteeredAim, aTurnIsFollowedAtTheRateLimitAsARotation) {
  SteeredRun run;
  const double half = 0.6;
  run.target({0, 0, 0.03}, {std::sin(half), 0, 0, std::cos(half)});
  run.go(3);
  EXPECT_LE(run.peak_radps, kMaxAimTurn_radps * (1 + 1e-6));
  EXPECT_GT(run.peak_radps, 0.9 * kMaxAimTurn_radps);
  EXPECT_NEAR(run.now.X_WT.q.x, std::sin(half), 1e-6);
  EXPECT_NEAR(dot(run.now.X_WT.q, run.now.X_WT.q), 1, 1e-12);
}

TEST(SteeredAim, stepsOfThirtyFramesASecondComeOutAsAnEvenMovement) {
  // 20 mm/s, commanded in steps of 0.67 mm
  SteeredRun run;
  const double frame_s = 1.0 / 30;
  for (int i = 1; i <= 15; ++i) {
    run.target({0, 0, 0.03 - 0.02 * i * frame_s});
    run.go(frame_s);
  }
  run.peak_mps = 0;
  double slowest = 1;
  for (int i = 16; i <= 30; ++i) {
    run.target({0, 0, 0.03 - 0.02 * i * frame_s});
    for (int k = 0; k < 10; ++k) {
      const Vec3 before = run.now.X_WT.p;
      run.go(frame_s / 10);
      slowest = std::min(slowest, norm(run.now.X_WT.p - before) / (frame_s / 10));
    }
  }
  EXPECT_LT(run.peak_mps, 0.025);
  EXPECT_GT(slowest, 0.015);
}

TEST(SteeredAim, thePlungerGoesNoFasterThanAThumb) {
  SteeredRun run;
  run.target({0, 0, 0.03}, {}, 1);
  run.go(0.5);
  EXPECT_NEAR(run.now.plunger, 0.1 + 0.5 * kMaxPlungerSpeed_per_s, 1e-4);
  run.go(2);
  EXPECT_EQ(run.now.plunger, 1);
}

TEST(SteeredAim, aWishThatIsNoPoseIsPassedOver) {
  SteeredRun run;
  run.target({0, 0, std::numeric_limits<double>::quiet_NaN()});
  run.go(0.1);
  run.target({0, 0, 0}, {0, 0, 0, 2});
  run.go(0.1);
  run.target({0, 0, 0}, {}, std::numeric_limits<double>::infinity());
  run.go(0.1);
  EXPECT_EQ(run.now.X_WT.p, (Vec3{0, 0, 0.03}));
  EXPECT_EQ(run.now.plunger, 0.1);
}

SceneSpec flatScene() {
  SceneSpec scene;
  scene.limb = PlaneLimb{{0, 0, 0}, {0, 0, 1}};
  scene.needle_length_m = 0.06;
  return scene;
}

TEST(SteeredStart, isOnThePlannedLineTiltedAsPlanned) {
  // 45 degrees: the target's depth on the line is that of its foot
  const double c = std::sqrt(0.5);
  const std::vector<PlanTarget> targets = {{"deep", {0.03, 0.001, -0.03}, Vec3{0.01, 0, 0}}};
  const PlannedLine line{{0, 0, 0}, {c, 0, -c}};
  const PlannedInsertion way = plannedInsertion(flatScene(), targets, line);
  EXPECT_NEAR(way.depth_m, 0.03 / c, 1e-12);
  const HandAim start = steeredStart(way).start();
  EXPECT_NEAR(norm(start.X_WT.p - Vec3{-0.03 * c, 0, 0.03 * c}), 0, 1e-12);
  EXPECT_NEAR(norm(zAxis(start.X_WT.q) - Vec3{c, 0, -c}), 0, 1e-12);
  EXPECT_GT(start.plunger, 0) << "one can aspirate";
}

TEST(SteeredStart, withoutAPlanIsOnTheWayFromTheMarkedEntryOrStraightIn) {
  const std::vector<PlanTarget> targets = {{"deep", {0.01, 0.04, -0.03}, Vec3{0.01, 0, 0}}};
  const Pose X_WT = steeredStart(plannedInsertion(flatScene(), targets, {})).start().X_WT;
  EXPECT_NEAR(norm(X_WT.p - Vec3{0.01, -0.024, 0.018}), 0, 1e-12) << "3-4-5";
  EXPECT_NEAR(norm(zAxis(X_WT.q) - Vec3{0, 0.8, -0.6}), 0, 1e-12);
  const Pose straight = steeredStart(plannedInsertion(flatScene(), {}, {})).start().X_WT;
  EXPECT_NEAR(norm(straight.p - Vec3{0, 0, 0.03}), 0, 1e-12) << "the limb's reference point";
}

TEST(HandPlanChoice, pointerIsNoPlanToFollow) {
  HandOptions options;
  options.plan = kPointerPlan;
  const auto plan = choosePlan(options, flatScene(), {});
  ASSERT_FALSE(plan.ok());
  EXPECT_NE(plan.error().message.find("window"), std::string::npos);
}

TEST(SteeredHand, goesWhereItIsSteeredFeelsResistanceAndNeverFinishes) {
  SimulatedDeviceOptions options;
  options.steering = std::make_shared<HandSteering>();
  options.hand.tremor_m = 0;
  SimulatedDevice device(options, steeredStart(plannedInsertion(flatScene(), {}, {})));
  ASSERT_TRUE(device.open(kRate_hz).ok());
  DeviceReading reading;
  ASSERT_EQ(device.read(reading), DeviceRead::kFresh);
  const Vec3 start = reading.X_WH.p;
  EXPECT_NEAR(reading.plunger, kPlungerBeforeAspiration, 1e-12);

  options.steering->setTarget({{start - Vec3{0, 0, 0.01}, reading.X_WH.q}, 0});
  for (int i = 0; i < 3000; ++i) ASSERT_EQ(device.read(reading), DeviceRead::kFresh);
  EXPECT_NEAR(reading.X_WH.p.z, start.z - 0.01, 1e-4);
  EXPECT_EQ(reading.plunger, 0);
  EXPECT_NEAR(device.hand().wanted().p.z, start.z - 0.01, 1e-6);
}

}  // namespace
}  // namespace needlelab
