#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "client/device/falcon/falcon_geometry.h"
#include "client/device/falcon/falcon_kinematics.h"
#include "tests/support/random.h"

namespace needlelab::falcon {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

// The residual of the leg equation, directly from falcon_geometry.h with the C library, in m².
double equation(std::size_t leg, Vec3 p, double theta) {
  const double c = std::cos(kLegAngle_rad[leg]), s = std::sin(kLegAngle_rad[leg]);
  const double u = p.x * c + p.y * s - (kBaseRadius_m - kPlatformRadius_m + kThigh_m * std::cos(theta));
  const double v = -p.x * s + p.y * c - kFootAside_m;
  const double w = p.z - kThigh_m * std::sin(theta);
  const double length = kShortLinks_m + std::sqrt(kShin_m * kShin_m - v * v);
  return u * u + w * w - length * length;
}

// a grid over the specified cube and beyond, to the limit of the legs' reach
std::vector<Vec3> reachable(double half_m, int steps) {
  std::vector<Vec3> places;
  for (int i = 0; i <= steps; ++i)
    for (int j = 0; j <= steps; ++j)
      for (int k = 0; k <= steps; ++k) {
        const auto at = [&](int n) { return half_m * (2.0 * n / steps - 1); };
        const Vec3 p = kOrigin_F_m + Vec3{at(i), at(j), at(k)};
        if (inverseKinematics(p).flags == 0) places.push_back(p);
      }
  return places;
}

std::string text(Vec3 p) {
  return std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z);
}

TEST(FalconKinematics, inverseFitsTheLegsEquation) {
  const auto places = reachable(0.07, 24);
  ASSERT_GT(places.size(), 6000u);
  for (const Vec3 p : places) {
    const Legs legs = inverseKinematics(p);
    for (std::size_t i = 0; i < 3; ++i) ASSERT_NEAR(equation(i, p, legs.theta_rad[i]), 0, 1e-15) << text(p);
  }
}

// Joint by joint, without the leg's equation: hip, thigh, knee, the shin between its short links and out of
// the leg's plane, foot. Angles: thigh, the shin's direction in the plane, its inclination out of the plane.
Vec3 gripOfLeg(std::size_t leg, double thigh, double shin, double aside) {
  const double reach = kShortLinks_m + kShin_m * std::sin(aside);
  const double u = kBaseRadius_m + kThigh_m * std::cos(thigh) + reach * std::cos(shin) - kPlatformRadius_m;
  const double v = kShin_m * std::cos(aside) + kFootAside_m;
  const double w = kThigh_m * std::sin(thigh) + reach * std::sin(shin);
  const double c = std::cos(kLegAngle_rad[leg]), s = std::sin(kLegAngle_rad[leg]);
  return {c * u - s * v, s * u + c * v, w};
}

TEST(FalconKinematics, inverseFindsTheThighOfAMechanismBuiltJointByJoint) {
  test::Random random(3);
  for (std::size_t leg = 0; leg < 3; ++leg)
    for (int found = 0; found < 1000;) {
      const double thigh = random.in(kThetaMin_rad, kThetaMax_rad);
      const Vec3 p = gripOfLeg(leg, thigh, thigh + random.in(0.3, 2.5), random.in(kPi / 3, 2 * kPi / 3));
      const Legs legs = inverseKinematics(p);
      if (legs.flags != 0) continue;  // out of reach for another leg
      ++found;
      ASSERT_NEAR(legs.theta_rad[leg], thigh, 1e-9) << leg << ": " << text(p);
    }
}

TEST(FalconKinematics, forwardUndoesInverseOverTheWorkspace) {
  double worst = 0;
  for (const Vec3 p : reachable(0.07, 24)) {
    const Place back = forwardKinematics(inverseKinematics(p).theta_rad);
    ASSERT_EQ(back.flags, 0) << text(p);
    worst = std::max(worst, norm(back.p_F_m - p));
    // In the workspace the legs are far from singular.
    if (std::max({std::fabs(p.x), std::fabs(p.y), std::fabs(p.z - kOrigin_F_m.z)}) <= 0.04) {
      const double spread = legJacobian(p, inverseKinematics(p).theta_rad).spread();
      ASSERT_GT(std::fabs(spread), 0.15) << text(p);
    }
  }
  EXPECT_LT(worst, 1e-12);
}

TEST(FalconKinematics, everyAngleWithinTheStopsGivesAPlaceThatFits) {
  test::Random random(7);
  int away = 0;
  for (int n = 0; n < 20'000; ++n) {
    LegAngles theta;
    for (double& t : theta) t = kThetaMin_rad + (kThetaMax_rad - kThetaMin_rad) * random.unit();
    const Place place = forwardKinematics(theta);
    ASSERT_TRUE(isFinite(place.p_F_m));
    if ((place.flags & kOutOfReach) != 0) {
      ++away;
      continue;
    }
    ASSERT_EQ(place.flags & ~kNearSingular, 0);
    for (std::size_t i = 0; i < 3; ++i) ASSERT_NEAR(equation(i, place.p_F_m, theta[i]), 0, 1e-14);
  }
  // One eighth of the cube of angles is unreachable for the mechanism: it would pull the legs apart.
  EXPECT_LT(away, 3000);
}

TEST(FalconKinematics, homedDeviceInTheMiddleOfItsAxis) {
  // all θ equal: with no foot aside the grip is on the axis, its height follows from one triangle; 1 mm aside
  // turns it by less than 0.1 mm
  for (const double theta : {-0.2, 0.3, kThetaAtZero_rad, 1.2, 1.6}) {
    const Place place = forwardKinematics({theta, theta, theta});
    const double shin = kShortLinks_m + kShin_m;
    const double out = kBaseRadius_m - kPlatformRadius_m + kThigh_m * std::cos(theta);
    EXPECT_NEAR(place.p_F_m.x, 0, 1e-12);
    EXPECT_NEAR(place.p_F_m.y, 0, 1e-12);
    EXPECT_NEAR(place.p_F_m.z, kThigh_m * std::sin(theta) + std::sqrt(shin * shin - out * out), 1e-4);
  }
}

TEST(FalconKinematics, aLegThatRisesPushesTheGripAwayFromItself) {
  // Leg 0 is on top: a larger θ lowers the grip and moves it toward the user.
  const LegAngles middle = inverseKinematics(kOrigin_F_m).theta_rad;
  const Place place = forwardKinematics({middle[0] + 0.1, middle[1], middle[2]});
  EXPECT_LT(place.p_F_m.y, -0.001);
  EXPECT_GT(place.p_F_m.z, kOrigin_F_m.z + 0.001);
}

TEST(FalconKinematics, framesAreRightHandedAndTurnBack) {
  EXPECT_EQ(vectorToW({0, 0, 1}), (Vec3{1, 0, 0})) << "toward the user";
  EXPECT_EQ(vectorToW({1, 0, 0}), (Vec3{0, 1, 0})) << "to the user's right";
  EXPECT_EQ(vectorToW({0, 1, 0}), (Vec3{0, 0, 1})) << "up";
  const Vec3 a{0.1, -0.2, 0.3}, b{0.5, 0.1, -0.4};
  EXPECT_EQ(cross(vectorToW(a), vectorToW(b)), vectorToW(cross(a, b)));
  EXPECT_EQ(vectorToF(vectorToW(a)), a);
  EXPECT_LT(norm(pointToF(pointToW(a)) - a), 1e-16);
  EXPECT_EQ(pointToW(kOrigin_F_m), Vec3{});
}

TEST(FalconKinematics, jacobianIsTheCentralDifferenceOfForward) {
  const double h = 1e-5;
  double worst = 0;
  for (const Vec3 p : reachable(0.06, 12)) {
    const LegAngles theta = inverseKinematics(p).theta_rad;
    const LegJacobian legs = legJacobian(p, theta);
    const auto columns = placePerAngle(legs);
    for (std::size_t i = 0; i < 3; ++i) {
      LegAngles more = theta, less = theta;
      more[i] += h;
      less[i] -= h;
      const Place a = forwardKinematics(more), b = forwardKinematics(less);
      if ((a.flags | b.flags) != 0) continue;  // at a stop
      const Vec3 difference = (a.p_F_m - b.p_F_m) / (2 * h);
      worst = std::max(worst, norm(difference - columns[i]) / (norm(columns[i]) + 0.01));
    }
  }
  EXPECT_LT(worst, 1e-6);
}

TEST(FalconKinematics, torquesDoTheForcesWork) {
  test::Random random(11);
  double worst = 0;
  for (const Vec3 p : reachable(0.05, 10)) {
    const LegAngles theta = inverseKinematics(p).theta_rad;
    const auto part = [&] { return 2 * random.unit() - 1; };
    const Vec3 force{8 * part(), 8 * part(), 8 * part()};
    const Torques torques = torquesForForce(legJacobian(p, theta), force);
    if (torques.flags != 0) continue;
    // the work of a small move, from inverse kinematics alone
    const Vec3 step = 1e-6 * Vec3{part(), part(), part()};
    const Legs ahead = inverseKinematics(p + step), behind = inverseKinematics(p - step);
    if ((ahead.flags | behind.flags) != 0) continue;
    double work = 0;
    for (std::size_t i = 0; i < 3; ++i)
      work += torques.thigh_Nm[i] * (ahead.theta_rad[i] - behind.theta_rad[i]);
    worst = std::max(worst, std::fabs(work - 2 * dot(force, step)) / (norm(force) * norm(step)));
  }
  EXPECT_LT(worst, 1e-6);
}

TEST(FalconKinematics, centrePullTowardTheUserLoadsAllLegsEqually) {
  const LegAngles theta = inverseKinematics(kOrigin_F_m).theta_rad;
  const Torques torques = torquesForForce(legJacobian(kOrigin_F_m, theta), {0, 0, 3});
  EXPECT_EQ(torques.flags, 0);
  EXPECT_GT(torques.thigh_Nm[0], 0) << "a thigh that rises pushes the grip out";
  EXPECT_NEAR(torques.thigh_Nm[1], torques.thigh_Nm[0], 1e-12);
  EXPECT_NEAR(torques.thigh_Nm[2], torques.thigh_Nm[0], 1e-12);
  // each does one third of the work: dz/dθ of a triangle with sides a and the shin
  const double shin = kShortLinks_m + std::sqrt(kShin_m * kShin_m - kFootAside_m * kFootAside_m);
  const double t = theta[0];
  const double out = kBaseRadius_m - kPlatformRadius_m + kThigh_m * std::cos(t);
  const double rise =
      kThigh_m * std::cos(t) + out * kThigh_m * std::sin(t) / std::sqrt(shin * shin - out * out);
  EXPECT_NEAR(torques.thigh_Nm[0], rise, 1e-9);
}

TEST(FalconKinematics, motorCommandsUseTheirOwnUnits) {
  const MotorUnits units = motorUnits({{0.1, -0.2, 0}, 0});
  EXPECT_EQ(units.flags, 0);
  EXPECT_EQ(units.value[0], std::lround(-0.1 / 7.62 / 1.9835e-5));
  EXPECT_EQ(units.value[1], std::lround(0.2 / 7.62 / 1.9835e-5));
  EXPECT_EQ(units.value[2], 0);
  // Too much for one motor: all are scaled, so the force keeps its direction.
  const MotorUnits held = motorUnits({{1.0, -0.5, 0.25}, 0});
  EXPECT_EQ(held.flags, kTorqueLimited);
  EXPECT_EQ(held.value[0], -kMotorMax);
  EXPECT_NEAR(held.value[1], kMotorMax / 2.0, 1);
  EXPECT_NEAR(held.value[2], -kMotorMax / 4.0, 1);
}

TEST(FalconKinematics, motorsAtTheirMostGiveTheMakersPeakForceInTheMiddle) {
  // the weakest direction, by the literature's torque constant and lengths, checked with the manufacturer's 2
  // lbf: two independent sources
  const LegJacobian legs = legJacobian(kOrigin_F_m, inverseKinematics(kOrigin_F_m).theta_rad);
  const double max_Nm = kMotorMax * kMotorNm_per_unit * kGearRatio;
  double weakest_N = 1e9;
  constexpr int kDirections = 4000;
  for (int i = 0; i < kDirections; ++i) {
    // evenly over the sphere: a spiral by the golden angle
    const double z = 2 * (i + 0.5) / kDirections - 1, around = i * 2.399963, r = std::sqrt(1 - z * z);
    const Torques torques = torquesForForce(legs, {r * std::cos(around), r * std::sin(around), z});
    double greatest = 0;
    for (const double torque : torques.thigh_Nm) greatest = std::max(greatest, std::fabs(torque));
    weakest_N = std::min(weakest_N, max_Nm / greatest);
  }
  EXPECT_NEAR(weakest_N, kLimits.peak_force_N, 0.2);
}

TEST(FalconKinematics, encodersAndAnglesTurnBack) {
  EXPECT_DOUBLE_EQ(thetaOfCounts(0), 40 * kPi / 180);
  EXPECT_NEAR(thetaOfCounts(1280) - thetaOfCounts(0), 2 * kPi / 7.62, 1e-15);
  for (int counts = -1700; counts <= 1700; ++counts) ASSERT_EQ(countsOfTheta(thetaOfCounts(counts)), counts);
  EXPECT_EQ(countsOfTheta(1e9), 32767);
  EXPECT_EQ(countsOfTheta(-1e9), -32768);
  EXPECT_EQ(countsOfTheta(kNan), 0);
}

TEST(FalconKinematics, oneEncoderStepMovesTheGripLessThanATenthMillimetre) {
  const LegAngles theta = inverseKinematics(kOrigin_F_m).theta_rad;
  for (const Vec3 column : placePerAngle(legJacobian(kOrigin_F_m, theta))) {
    const double step = norm(column) / kCountsPerRad;
    EXPECT_GT(step, 1e-5);
    EXPECT_LT(step, 1e-4);
  }
}

TEST(FalconKinematics, beyondTheEdgeTheNearestPoseIsReportedAndFlagged) {
  for (const Vec3 away : {Vec3{0.3, 0, 0}, Vec3{0, -0.3, 0}, Vec3{0, 0, 0.3}, Vec3{0, 0, -0.4}, Vec3{9, 9, 9},
                          Vec3{1e200, 0, 0}, Vec3{0, 0, -0.125}}) {
    const Legs legs = inverseKinematics(kOrigin_F_m + away);
    EXPECT_NE(legs.flags, 0) << text(away);
    for (const double theta : legs.theta_rad) {
      EXPECT_GE(theta, kThetaMin_rad);
      EXPECT_LE(theta, kThetaMax_rad);
    }
  }
  // Pulled out fully: at the limit of the legs' reach, not beyond it.
  const Place out = forwardKinematics({kThetaMax_rad, kThetaMax_rad, kThetaMax_rad});
  EXPECT_EQ(out.flags & ~kNearSingular, 0);
  const Place more = forwardKinematics({9, 9, 9});
  EXPECT_EQ(more.flags & kBeyondStop, kBeyondStop);
  EXPECT_EQ(more.p_F_m, out.p_F_m);
}

TEST(FalconKinematics, whatIsNoNumberNeverComesOut) {
  const double odd[] = {kNan, kInf, -kInf, 1e300, -1e300, 0, 1, -4};
  for (const double a : odd)
    for (const double b : odd)
      for (const double c : odd) {
        const Place place = forwardKinematics({a, b, c});
        ASSERT_TRUE(isFinite(place.p_F_m));
        const Legs legs = inverseKinematics({a, b, c});
        for (const double theta : legs.theta_rad) ASSERT_TRUE(std::isfinite(theta));
        const LegJacobian jacobian = legJacobian(kOrigin_F_m, {0.5, 0.6, 0.7});
        const MotorUnits units = motorUnits(torquesForForce(jacobian, {a, b, c}));
        for (const auto value : units.value) ASSERT_LE(std::abs(value), kMotorMax);
        const bool finite_in = std::isfinite(a) && std::isfinite(b) && std::isfinite(c);
        if (!finite_in) {
          EXPECT_EQ(place.flags, kInputNotFinite);
          EXPECT_EQ(legs.flags, kInputNotFinite);
          EXPECT_EQ(units.flags & kInputNotFinite, kInputNotFinite);
          EXPECT_EQ(units.value, (std::array<std::int16_t, 3>{}));
        }
      }
}

TEST(FalconKinematics, everyEncoderReadingGivesABoundedPlaceAndBoundedMotors) {
  test::Random random(3);
  for (int n = 0; n < 50'000; ++n) {
    std::array<std::int16_t, 3> encoder;
    const bool wild = n % 2 == 0;
    for (auto& e : encoder) e = static_cast<std::int16_t>((wild ? 65536 : 4000) * (random.unit() - 0.5));
    const LegAngles theta = anglesOfEncoders(encoder);
    const Place place = forwardKinematics(theta);
    ASSERT_TRUE(isFinite(place.p_F_m));
    ASSERT_LT(norm(place.p_F_m), 0.3) << encoder[0] << " " << encoder[1] << " " << encoder[2];
    const MotorUnits units = motorUnits(torquesForForce(legJacobian(place.p_F_m, theta), {3, -8, 2}));
    for (const auto value : units.value) ASSERT_LE(std::abs(value), kMotorMax);
  }
}

TEST(FalconKinematics, torquesFadeWhereTheLegsCannotBearTheForce) {
  // Shins nearly in one plane, constructed: n_2 tilts out of the plane of the others by smaller and smaller
  // angles.
  LegJacobian legs;
  legs.n = {Vec3{0.1, 0, 0}, Vec3{-0.05, 0.09, 0}, Vec3{}};
  legs.m = {0.006, 0.006, 0.006};
  double before = 0;
  for (const double tilt : {0.2, 0.05, 0.02, 0.005, 0.0005, 0.0}) {
    legs.n[2] = {-0.05, -0.09, tilt * 0.1};
    const Torques torques = torquesForForce(legs, {0, 0, 5});
    const double greatest = std::max(
        {std::fabs(torques.thigh_Nm[0]), std::fabs(torques.thigh_Nm[1]), std::fabs(torques.thigh_Nm[2])});
    EXPECT_EQ(torques.flags, tilt < 0.06 ? kNearSingular : 0) << tilt;
    if (tilt < 0.04) {
      EXPECT_LT(greatest, before) << tilt;
    }
    before = greatest;
  }
  EXPECT_EQ(before, 0) << "in the plane nothing is left";
}

TEST(FalconKinematics, placeOfSomeEncodersToTheLastBit) {
  // Same result on every machine and in every build.
  const LegAngles theta = anglesOfEncoders({-350, 120, 511});
  const Place place = forwardKinematics(theta);
  EXPECT_EQ(place.flags, 0);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(equation(i, place.p_F_m, theta[i]), 0, 1e-16);
  EXPECT_EQ(place.p_F_m, (Vec3{0x1.37b83ec3daaeep-7, 0x1.1abbce3b46df5p-5, 0x1.2524490b702a7p-3}));
}

}  // namespace
}  // namespace needlelab::falcon
