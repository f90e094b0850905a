// Checks position, force and homing of the device `falcon` against the emulator's own mechanics.
#include <random>
#include <thread>
#include <utility>

#include "client/device/falcon/falcon_geometry.h"
#include "common/haptics/device_condition.h"
#include "tests/unit/client/device/falcon_usb/falcon_on_usb.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using Eigen::Vector3d;

Vector3d toF(Vec3 p_W_m) {
  const Vec3 p = falcon::pointToF(p_W_m);
  return {p.x, p.y, p.z};
}

bool withinStops(const AllLegs& legs) {
  for (const LegAngles& leg : legs)
    if (leg[0] < falcon::kThetaMin_rad || leg[0] > falcon::kThetaMax_rad) return false;
  return true;
}

// positions of the specified cube that the mechanism reaches
std::vector<Vector3d> placesInTheWorkspace(int count, double half_m) {
  std::mt19937_64 random(42);
  std::uniform_real_distribution<> along(-half_m, half_m);
  std::vector<Vector3d> places;
  while (static_cast<int>(places.size()) < count) {
    const Vector3d p(along(random), along(random), falcon::kOrigin_F_m.z + along(random));
    try {
      if (withinStops(anglesAt(p))) places.push_back(p);
    } catch (const std::runtime_error&) {
    }
  }
  return places;
}

TEST_F(FalconOnUsb, tellsTheGripsPlaceAllOverTheWorkspace) {
  openDevice();
  home();
  double worst_m = 0, worst_of_counts_m = 0;
  for (const Vector3d& p : placesInTheWorkspace(60, falcon::kWorkspaceHalf_m)) {
    falcon_.holdAt(p);
    settle(5ms);
    const Vector3d told = toF(reading_.X_WH.p);
    worst_m = std::max(worst_m, (told - p).norm());
    // the remaining error after the rounding to whole encoder counts
    Vector3d counted;
    const AllLegs legs = anglesAt(p);
    for (int leg = 0; leg < 3; ++leg) {
      const double counts = std::round((legs[static_cast<std::size_t>(leg)][0] - falcon::kThetaAtZero_rad) *
                                       falcon::kCountsPerRad);
      counted[leg] = falcon::kThetaAtZero_rad + counts / falcon::kCountsPerRad;
    }
    worst_of_counts_m = std::max(worst_of_counts_m, (told - gripAt(counted)).norm());
  }
  RecordProperty("worst_um", static_cast<int>(1e6 * worst_m));
  EXPECT_LT(worst_m, 1e-4);
  EXPECT_LT(worst_of_counts_m, 1e-8);
}

TEST_F(FalconOnUsb, theHandFeelsTheForceThatIsAskedFor) {
  openDevice();
  home();
  // A motor's unit is 2.5 mN at the end of a thigh: half of it on each leg is 2-4 mN. One percent of 2.5 N is
  // 25 mN, so rounding to whole units never uses it up.
  double worst = 0;
  int ramp_ticks = 300;
  for (const Vector3d& p : placesInTheWorkspace(6, 0.03)) {
    falcon_.holdAt(p);
    for (const Vec3 wanted : {Vec3{2.5, 0, 0}, Vec3{0, 2.5, 0}, Vec3{0, 0, -2.5}, Vec3{-1.5, 1.5, 1.2}}) {
      // The first time, the start ramp must pass; after that, the slew limit.
      const std::uint64_t commands = falcon_.commands();
      int ticks = std::exchange(ramp_ticks, 30);
      runTicks(2s, [&] {
        device_->read(reading_);
        device_->write(pusher_.push(wanted));
        return --ticks > 0 || falcon_.commands() < commands + 10;
      });
      const Vec3 asked_F = falcon::vectorToF(wanted);
      const Vector3d asked(asked_F.x, asked_F.y, asked_F.z);
      const double off = (falcon_.force() - asked).norm() / asked.norm();
      EXPECT_LT(off, 0.01) << p.transpose() << ": " << falcon_.force().transpose();
      worst = std::max(worst, off);
    }
  }
  RecordProperty("worst_permille", static_cast<int>(1000 * worst));
}

TEST_F(FalconOnUsb, aSoftHandIsPushedToWhereItsSpringBalances) {
  openDevice();
  home();
  const Vector3d middle(0, 0, falcon::kOrigin_F_m.z);
  falcon_.holdSoftly({.mass_kg = 0.25, .stiffness_N_per_m = 300, .damping_Ns_per_m = 20},
                     [middle](double) { return middle; });
  runTicks(900ms, [&] {
    device_->read(reading_);
    device_->write(pusher_.push({0, 0, 2}));  // up
    return true;
  });
  EXPECT_NEAR(reading_.X_WH.p.z, 2.0 / 300, 2e-4);
  EXPECT_NEAR(reading_.X_WH.p.x, 0, 2e-4);
  EXPECT_NEAR(reading_.X_WH.p.y, 0, 2e-4);
}

TEST_F(FalconOnUsb, speedIsTheHands) {
  openDevice();
  home();
  falcon_.holdRigidly([](double t) { return Vector3d(0, -0.05 * t, falcon::kOrigin_F_m.z); });
  double sum = 0;
  int count = 0;
  runTicks(400ms, [&, end = Clock::now() + 350ms] {
    if (device_->read(reading_) == DeviceRead::kFresh) {
      sum += reading_.speed_mps;
      ++count;
    }
    device_->write(pusher_.push({}));
    return Clock::now() < end;
  });
  EXPECT_NEAR(sum / count, 0.05, 0.01);
}

TEST_F(FalconOnUsb, beforeItsZeroIsFoundThereIsNoPlaceAndNoForce) {
  openDevice();
  runTicks(300ms, [this] {
    EXPECT_EQ(device_->read(reading_), DeviceRead::kNoUpdate);
    device_->write(pusher_.push({2, 0, 0}));
    return true;
  });
  EXPECT_TRUE(reading_.condition & kDeviceNotReady);
  EXPECT_NE(device_->status().find("pull"), std::string::npos) << device_->status();
  EXPECT_EQ(falcon_.lights(), falcon::kOutRed);
  const auto history = falcon_.history();
  for (const CommandSeen& seen : history) EXPECT_EQ(seen.motors, (std::array<std::int16_t, 3>{}));
  EXPECT_EQ(history.back().bits & falcon::kOutHome, falcon::kOutHome);
  home();
  EXPECT_EQ(reading_.condition & kDeviceNotReady, 0u);
  EXPECT_TRUE(waitUntil([this] { return device_->status().empty(); })) << device_->status();
  EXPECT_EQ(falcon_.lights(), falcon::kOutGreen);
}

TEST_F(FalconOnUsb, buttonsAreThoseOfTheGrip) {
  openDevice();
  home();
  falcon_.setButtons(0b0101);
  settle();
  EXPECT_EQ(reading_.buttons, 0b0101u);
}

}  // namespace
}  // namespace needlelab::test
