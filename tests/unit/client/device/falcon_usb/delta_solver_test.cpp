#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>

#include "client/device/falcon/falcon_geometry.h"
#include "tests/support/falcon_emulator/delta_solver.h"

namespace needlelab::test {
namespace {

using Eigen::Vector3d;

Vector3d anyPlace(std::mt19937_64& random, double half_m) {
  std::uniform_real_distribution<> along(-half_m, half_m);
  return Vector3d(falcon::kOrigin_F_m.x + along(random), falcon::kOrigin_F_m.y + along(random),
                  falcon::kOrigin_F_m.z + along(random));
}

TEST(DeltaSolver, legsCloseAndTheGripComesBack) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 300; ++i) {
    const Vector3d p = anyPlace(random, 0.03);
    const AllLegs angles = anglesAt(p);
    for (std::size_t leg = 0; leg < 3; ++leg) EXPECT_LT(loopError(leg, angles[leg], p).norm(), 1e-12);
    EXPECT_LT((gripAt({angles[0][0], angles[1][0], angles[2][0]}) - p).norm(), 1e-10) << p.transpose();
  }
}

TEST(DeltaSolver, shinKeepsItsLength) {
  // The long links of a shin are rods: the distance from knee to foot, minus the short links, must equal
  // their length.
  std::mt19937_64 random(2);
  for (int i = 0; i < 100; ++i) {
    const AllLegs angles = anglesAt(anyPlace(random, 0.03));
    for (const LegAngles& leg : angles) {
      const double rod = std::hypot(falcon::kShin_m * std::sin(leg[2]), falcon::kShin_m * std::cos(leg[2]));
      EXPECT_NEAR(rod, falcon::kShin_m, 1e-12);
    }
  }
}

TEST(DeltaSolver, ratesAreDifferences) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 100; ++i) {
    const Vector3d p = anyPlace(random, 0.03);
    const Eigen::Matrix3d rates = thighRates(anglesAt(p));
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d step = 1e-6 * Vector3d::Unit(axis);
      const AllLegs ahead = anglesAt(p + step), behind = anglesAt(p - step);
      for (std::size_t leg = 0; leg < 3; ++leg)
        EXPECT_NEAR((ahead[leg][0] - behind[leg][0]) / 2e-6, rates(static_cast<Eigen::Index>(leg), axis),
                    1e-4);
    }
  }
}

TEST(DeltaSolver, forceDoesTheWorkOfTheTorques) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<> torque(-0.3, 0.3);
  for (int i = 0; i < 100; ++i) {
    const Vector3d p = anyPlace(random, 0.03), tau(torque(random), torque(random), torque(random));
    const AllLegs angles = anglesAt(p);
    const Vector3d along = 1e-6 * Vector3d(torque(random), torque(random), torque(random)).normalized();
    const AllLegs ahead = anglesAt(p + along), behind = anglesAt(p - along);
    double work = 0;
    for (std::size_t leg = 0; leg < 3; ++leg)
      work += tau[static_cast<Eigen::Index>(leg)] * (ahead[leg][0] - behind[leg][0]) / 2;
    EXPECT_NEAR(forceOf(angles, tau).dot(along), work, 1e-10);
  }
}

TEST(DeltaSolver, refusesWhatTheMechanismCannotReach) {
  EXPECT_THROW((void)anglesAt(Vector3d(0, 0, 0.3)), std::runtime_error);
  EXPECT_THROW((void)anglesAt(Vector3d(0.25, 0, 0.125)), std::runtime_error);
}

}  // namespace
}  // namespace needlelab::test
