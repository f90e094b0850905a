// The Falcon as a Device, in simulated time; at the end with real threads, for ThreadSanitizer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <thread>

#include "client/device/falcon/falcon_device.h"
#include "client/device/falcon/falcon_geometry.h"
#include "common/haptics/device_condition.h"
#include "tests/support/device_world.h"
#include "tests/support/fake_falcon.h"
#include "tests/support/temp_folder.h"

namespace needlelab::falcon {
namespace {

using testing::HasSubstr;
using Motors = std::array<std::int16_t, 3>;

/// Returns the encoder counts of a position as a homed device reports them.
Motors encodersAt(Vec3 p_F_m) {
  const Legs legs = inverseKinematics(p_F_m);
  EXPECT_EQ(legs.flags, 0);
  return {countsOfTheta(legs.theta_rad[0]), countsOfTheta(legs.theta_rad[1]),
          countsOfTheta(legs.theta_rad[2])};
}

/// Returns a force that has passed the gate.
GuardedWrench guarded(Vec3 f_W_N) {
  ForceGate gate(kLimits, 1000);
  TipSample tip;
  GuardedWrench out;
  for (int i = 0; i < 400; ++i) {
    gate.admit(tip, true, 0);
    out = gate.guard({f_W_N, {}});
  }
  EXPECT_LT(norm(out.wrench().force_N - f_W_N), 1e-9);
  return out;
}

class FalconDeviceTest : public testing::Test {
 protected:
  explicit FalconDeviceTest(bool is_simulated = true)
      : time_(is_simulated ? static_cast<TimeSource&>(world_) : machineTime()),
        threads_(is_simulated ? static_cast<TurnRunner&>(world_) : machineThreads()) {}
  void SetUp() override {
    ::unsetenv("NEEDLELAB_FALCON_FIRMWARE");
    world_.listen("falcon-usb", [this] { return falcon_->nextEventNs(); });
  }

  std::unique_ptr<FalconDevice> make(FalconOptions options = {}) {
    return std::make_unique<FalconDevice>(std::move(options), std::make_unique<FakeBus>(falcon_, time_),
                                          time_, threads_);
  }
  std::unique_ptr<FalconDevice> opened(FalconOptions options = {}) {
    auto device = make(std::move(options));
    const Status done = device->open(1000);
    EXPECT_TRUE(done.ok()) << done.error().message;
    return device;
  }
  template <typename Use>
  auto with(Use&& use) {
    const std::scoped_lock lock(falcon_->mutex);
    return use(*falcon_);
  }
  /// Reads and writes a thousand times per second until `done`, for at most 5 s.
  bool loopUntil(FalconDevice& device, const std::function<bool()>& done, const GuardedWrench& wrench = {}) {
    for (int i = 0; i < 5000; ++i) {
      last_ = device.read(reading_);
      if (done()) return true;
      device.write(wrench);
      time_.sleepForNs(test::kMs);
    }
    return false;
  }
  bool loopUntilFresh(FalconDevice& device) {
    return loopUntil(device, [&] { return last_ == DeviceRead::kFresh; });
  }
  std::string firmwareFile() { return folder_.write("fw.bin", std::string(5000, 'f')).string(); }

  test::DeviceWorld world_;
  TimeSource& time_;
  TurnRunner& threads_;
  std::shared_ptr<FakeFalcon> falcon_ = std::make_shared<FakeFalcon>();
  test::TempFolder folder_;
  DeviceReading reading_;
  DeviceRead last_ = DeviceRead::kNoUpdate;
};

TEST_F(FalconDeviceTest, saysWhatItIs) {
  const auto device = make();
  EXPECT_FALSE(device->info().renders_torque);
  EXPECT_FALSE(device->info().has_orientation);
  EXPECT_TRUE(device->info().renders_force);
  EXPECT_FALSE(device->info().has_dead_man);
  EXPECT_EQ(device->info().max_rate_hz, 1000);
  EXPECT_EQ(device->info().plunger, PlungerSource::kButtons);
  EXPECT_EQ(device->info().limits.peak_force_N, 8.9);
  EXPECT_EQ(device->info().limits.peak_torque_Nm, 0);
}

TEST_F(FalconDeviceTest, placeOfTheGripInWAndItsButtons) {
  with([](FakeFalcon& f) { f.encoder = encodersAt({0.02, -0.01, 0.115}), f.buttons = 0b0110; });
  const auto device = opened();
  ASSERT_TRUE(loopUntilFresh(*device));
  // X toward the user from the middle at 125 mm, Y to the right, Z up; an encoder step is about 0.03 mm
  EXPECT_NEAR(reading_.X_WH.p.x, -0.010, 5e-5);
  EXPECT_NEAR(reading_.X_WH.p.y, 0.020, 5e-5);
  EXPECT_NEAR(reading_.X_WH.p.z, -0.010, 5e-5);
  EXPECT_EQ(reading_.X_WH.q, Quat{});
  EXPECT_EQ(reading_.buttons, 0b0110u);
  EXPECT_EQ(reading_.condition, 0u);
  EXPECT_EQ(reading_.speed_mps, 0);
  EXPECT_EQ(device->clampedTicks(), 0u);
}

TEST_F(FalconDeviceTest, motorsDoTheWorkOfTheForce) {
  const Vec3 p_F_m{0.015, 0.01, 0.13}, f_W_N{1.5, -0.7, 0.9};
  with([&](FakeFalcon& f) { f.encoder = encodersAt(p_F_m); });
  const auto device = opened();
  ASSERT_TRUE(loopUntilFresh(*device));
  ASSERT_TRUE(loopUntil(
      *device, [&] { return falcon_->last().motor != Motors{}; }, guarded(f_W_N)));
  const Motors motor = falcon_->last().motor;
  // torque of a thigh from its motor by published constants; work of a small move from the inverse kinematics
  const LegAngles theta = anglesOfEncoders(encodersAt(p_F_m));
  const Vec3 p = forwardKinematics(theta).p_F_m;
  for (const Vec3 step_W : {Vec3{1e-6, 0, 0}, Vec3{0, 1e-6, 0}, Vec3{0, 0, 1e-6}}) {
    const Vec3 step_F = vectorToF(step_W);
    const LegAngles ahead = inverseKinematics(p + step_F).theta_rad,
                    behind = inverseKinematics(p - step_F).theta_rad;
    double work = 0;
    for (std::size_t i = 0; i < 3; ++i) work += -motor[i] * 1.9835e-5 * 7.62 * (ahead[i] - behind[i]) / 2;
    EXPECT_NEAR(work, dot(f_W_N, step_W), 0.01 * 1e-6);
  }
}

TEST_F(FalconDeviceTest, speedIsThatOfTheGrip) {
  const auto device = opened();
  // 0.2 m/s toward the user, for 0.15 s
  for (int ms = 0; ms < 150; ++ms) {
    with([&](FakeFalcon& f) { f.encoder = encodersAt({0, 0, 0.11 + 0.2e-3 * ms}); });
    time_.sleepForNs(test::kMs);
    ASSERT_EQ(device->read(reading_), DeviceRead::kFresh);
    // over eight reports; an encoder step is about 0.03 mm
    if (ms > 20) {
      ASSERT_NEAR(reading_.speed_mps, 0.2, 0.006) << ms;
    }
  }
}

TEST_F(FalconDeviceTest, withoutZeroThereIsNoPlaceAndNoTorqueButWords) {
  with([](FakeFalcon& f) { f.homed = 0x30; });
  const auto device = opened();
  const GuardedWrench force = guarded({2, 0, 0});
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(device->read(reading_), DeviceRead::kNoUpdate);
    ASSERT_EQ(reading_.condition & kDeviceNotReady, kDeviceNotReady);
    device->write(force);
    time_.sleepForNs(test::kMs);
  }
  EXPECT_THAT(device->status(), HasSubstr("pull the grip out"));
  EXPECT_FALSE(device->status().ends_with('.')) << "the station goes on with \": no force\"";
  EXPECT_EQ(falcon_->last(), (Command{{}, kOutHome | kOutRed}));

  // The hand completes the homing.
  with([](FakeFalcon& f) { f.homed = 0x70; });
  ASSERT_TRUE(loopUntilFresh(*device));
  ASSERT_TRUE(loopUntil(*device, [&] { return device->status().empty(); }));
  EXPECT_EQ(falcon_->last().bits, kOutGreen);
}

TEST_F(FalconDeviceTest, hapticThreadThatStopsMeansZeroTorqueAfterTwentyMilliseconds) {
  const auto device = opened();
  ASSERT_TRUE(loopUntil(
      *device, [&] { return falcon_->last().motor != Motors{}; }, guarded({3, 0, 0})));
  time_.sleepForNs(19 * test::kMs);
  EXPECT_NE(falcon_->last().motor, Motors{});
  time_.sleepForNs(3 * test::kMs);
  EXPECT_EQ(falcon_->last().motor, Motors{});
  time_.sleepForNs(200 * test::kMs);
  EXPECT_EQ(device->counts().starved_times, 1u);
}

TEST_F(FalconDeviceTest, closeSaysZeroTorqueLastAndLetsGo) {
  for (int round = 0; round < 5; ++round) {
    const auto device = opened();
    ASSERT_TRUE(loopUntil(
        *device, [&] { return falcon_->last().motor != Motors{}; }, guarded({3, 0, 0})));
    device->close();
    EXPECT_EQ(falcon_->last(), (Command{{}, 0}));
    EXPECT_EQ(with([](FakeFalcon& f) { return f.open_links; }), 0);
    device->close();
    EXPECT_EQ(device->read(reading_) == DeviceRead::kFinished, false) << "a late tick does no harm";
    device->write(guarded({1, 0, 0}));
  }
}

TEST_F(FalconDeviceTest, opensAgainAfterClose) {
  const auto device = opened();
  ASSERT_TRUE(loopUntilFresh(*device));
  device->close();
  ASSERT_TRUE(device->open(500).ok());
  EXPECT_TRUE(loopUntilFresh(*device));
}

TEST_F(FalconDeviceTest, unpluggedInMidStrokeIsLostAndComesBack) {
  with([](FakeFalcon& f) { f.buttons = 1; });
  const auto device = opened();
  const GuardedWrench force = guarded({3, 0, 0});
  ASSERT_TRUE(loopUntil(
      *device, [&] { return falcon_->last().motor != Motors{}; }, force));
  with([](FakeFalcon& f) { f.plugged = false; });
  ASSERT_TRUE(loopUntil(
      *device, [&] { return (reading_.condition & kDeviceLost) != 0; }, force));
  EXPECT_EQ(last_, DeviceRead::kNoUpdate);
  EXPECT_EQ(reading_.buttons, 0u) << "nobody presses the plunger of a device that is away";
  ASSERT_TRUE(loopUntil(*device, [&] { return device->status().find("plug in") != std::string::npos; }));
  EXPECT_FALSE(device->status().ends_with('.')) << "the station puts it into brackets";
  ASSERT_TRUE(loopUntil(*device, [&] { return with([](FakeFalcon& f) { return f.open_links; }) == 0; }));

  // Plugged in again without a loss of power: it continues
  const std::size_t before = falcon_->count();
  with([](FakeFalcon& f) { f.plugged = true; });
  ASSERT_TRUE(loopUntilFresh(*device));
  EXPECT_EQ(reading_.condition, 0u);
  EXPECT_EQ(with([](FakeFalcon& f) { return f.loads; }), 0);
  // It starts without torque, whatever was commanded before.
  with([&](FakeFalcon& f) {
    for (std::size_t i = before; i < std::min(before + 2, f.commands.size()); ++i)
      EXPECT_EQ(f.commands[i].motor, Motors{});
  });
}

TEST_F(FalconDeviceTest, pluggedInAgainWithoutFirmwareItIsLoadedAndLooksForItsZero) {
  FalconOptions options;
  options.firmware_file = firmwareFile();
  const auto device = opened(options);
  ASSERT_TRUE(loopUntilFresh(*device));
  with([](FakeFalcon& f) { f.plugged = false; });
  ASSERT_TRUE(loopUntil(*device, [&] { return (reading_.condition & kDeviceLost) != 0; }));
  with([](FakeFalcon& f) { f.plugged = true, f.runs = false, f.homed = 0; });
  ASSERT_TRUE(loopUntil(*device, [&] { return reading_.condition == kDeviceNotReady; }));
  EXPECT_EQ(with([](FakeFalcon& f) { return f.loads; }), 1);
  EXPECT_THAT(device->status(), HasSubstr("zero"));
  with([](FakeFalcon& f) { f.homed = 0x70; });
  EXPECT_TRUE(loopUntilFresh(*device));
}

TEST_F(FalconDeviceTest, pluggedInAgainWithoutFirmwareAndFileSaysSo) {
  const auto device = opened();
  with([](FakeFalcon& f) { f.plugged = false; });
  ASSERT_TRUE(loopUntil(*device, [&] { return (reading_.condition & kDeviceLost) != 0; }));
  with([](FakeFalcon& f) { f.plugged = true, f.runs = false; });
  ASSERT_TRUE(loopUntil(
      *device, [&] { return device->status().find("NEEDLELAB_FALCON_FIRMWARE") != std::string::npos; }));
  EXPECT_EQ(reading_.condition & kDeviceLost, kDeviceLost);
}

TEST_F(FalconDeviceTest, garbageIsTroubleInWordsWithoutTorque) {
  const auto device = opened();
  const GuardedWrench force = guarded({3, 0, 0});
  ASSERT_TRUE(loopUntil(
      *device, [&] { return falcon_->last().motor != Motors{}; }, force));
  with([](FakeFalcon& f) { f.garbage = true; });
  ASSERT_TRUE(loopUntil(
      *device, [&] { return (reading_.condition & kDeviceTrouble) != 0; }, force));
  ASSERT_TRUE(loopUntil(
      *device, [&] { return device->status().find("cannot be read") != std::string::npos; }, force));
  EXPECT_EQ(falcon_->last().motor, Motors{});
  with([](FakeFalcon& f) { f.garbage = false; });
  ASSERT_TRUE(loopUntilFresh(*device));
  EXPECT_TRUE(loopUntil(*device, [&] { return reading_.condition == 0 && device->status().empty(); }));
}

TEST_F(FalconDeviceTest, aDeviceThatFallsSilentIsTroubleThenOpenedAnew) {
  const auto device = opened();
  with([](FakeFalcon& f) { f.silent = true; });
  ASSERT_TRUE(loopUntil(*device, [&] { return (reading_.condition & kDeviceTrouble) != 0; }));
  EXPECT_EQ(reading_.condition & kDeviceOverrun, kDeviceOverrun);
  ASSERT_TRUE(loopUntil(*device, [&] { return with([](FakeFalcon& f) { return f.opened; }) > 1; }));
  with([](FakeFalcon& f) { f.silent = false; });
  EXPECT_TRUE(loopUntilFresh(*device));
}

TEST_F(FalconDeviceTest, firmwareIsLoadedOnceAndItsProgressSaid) {
  with([](FakeFalcon& f) { f.runs = false; });
  FalconOptions options;
  options.firmware_file = firmwareFile();
  std::vector<std::string> progress;
  options.progress = [&](const std::string& words) { progress.push_back(words); };
  const auto device = opened(options);
  EXPECT_EQ(with([](FakeFalcon& f) { return f.loaded; }), Bytes(5000, 'f'));
  ASSERT_GE(progress.size(), 10u);
  EXPECT_THAT(progress.front(), HasSubstr("0 %"));
  EXPECT_THAT(progress.back(), HasSubstr("100 %"));
  device->close();
  ASSERT_TRUE(device->open(1000).ok());
  EXPECT_EQ(with([](FakeFalcon& f) { return f.loads; }), 1) << "it runs already";
}

TEST_F(FalconDeviceTest, oneBadLoadIsTriedAgainThreeAreAnError) {
  with([](FakeFalcon& f) { f.runs = false, f.echo_wrong = 100; });
  FalconOptions options;
  options.firmware_file = firmwareFile();
  const auto device = make(options);
  const Status done = device->open(1000);
  ASSERT_FALSE(done.ok());
  EXPECT_THAT(done.error().message, HasSubstr("byte 100"));
  EXPECT_EQ(with([](FakeFalcon& f) { return f.loads; }), 3);
  EXPECT_EQ(with([](FakeFalcon& f) { return f.open_links; }), 0);
}

TEST_F(FalconDeviceTest, environmentNamesTheFirmwareToo) {
  with([](FakeFalcon& f) { f.runs = false; });
  ::setenv("NEEDLELAB_FALCON_FIRMWARE", firmwareFile().c_str(), 1);
  const auto device = opened();
  ::unsetenv("NEEDLELAB_FALCON_FIRMWARE");
  EXPECT_EQ(with([](FakeFalcon& f) { return f.loads; }), 1);
}

TEST_F(FalconDeviceTest, errorsOfOpenSayWhatToDo) {
  EXPECT_EQ(make()->open(1001).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(make()->open(std::nan("")).error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(make()->open(0).error().code, ErrorCode::kInvalidInput);

  with([](FakeFalcon& f) { f.plugged = false; });
  EXPECT_EQ(make()->open(1000).error().code, ErrorCode::kNotFound);
  with([](FakeFalcon& f) { f.plugged = true, f.runs = false; });
  EXPECT_THAT(make()->open(1000).error().message, HasSubstr("falcon:FILE"));
  FalconOptions options;
  options.firmware_file = "/nowhere/fw.bin";
  EXPECT_THAT(make(options)->open(1000).error().message, HasSubstr("/nowhere/fw.bin"));
  EXPECT_EQ(with([](FakeFalcon& f) { return f.open_links; }), 0) << "nothing is left open";
}

TEST(FalconSpec, whatFollowsTheKind) {
  EXPECT_EQ(falconOptions("")->which, "");
  EXPECT_EQ(falconOptions("")->firmware_file, "");
  EXPECT_EQ(falconOptions("@1-4.2")->which, "1-4.2");
  EXPECT_EQ(falconOptions(":fw.bin")->firmware_file, "fw.bin");
  const auto both = falconOptions(":/opt/falcon@home/fw.bin@FT12");
  EXPECT_EQ(both->firmware_file, "/opt/falcon@home/fw.bin");
  EXPECT_EQ(both->which, "FT12");
  EXPECT_EQ(falconOptions(":/opt/falcon@home/fw.bin")->firmware_file, "/opt/falcon@home/fw.bin");
  for (const char* bad : {":", "@", ":@1-2", ":fw.bin@", "x"})
    EXPECT_EQ(falconOptions(bad).ok() ? ErrorCode::kFailed : falconOptions(bad).error().code,
              ErrorCode::kInvalidInput)
        << bad;
}

// ---- real threads, without bounds on time

class FalconDeviceThreads : public FalconDeviceTest {
 protected:
  FalconDeviceThreads() : FalconDeviceTest(false) {}
};

TEST_F(FalconDeviceThreads, opensRendersIsLostComesBackAndCloses) {
  const GuardedWrench force = guarded({3, 0, 0});
  const auto device = opened();
  for (int round = 0; round < 3; ++round) {
    ASSERT_TRUE(loopUntil(
        *device, [&] { return falcon_->last().motor != Motors{}; }, force));
    falcon_->unplug();
    ASSERT_TRUE(loopUntil(
        *device, [&] { return (reading_.condition & kDeviceLost) != 0; }, force));
    falcon_->plugIn();
    ASSERT_TRUE(loopUntilFresh(*device));
  }
  device->close();
  EXPECT_EQ(falcon_->last(), (Command{{}, 0}));
  EXPECT_EQ(with([](FakeFalcon& f) { return f.open_links; }), 0);
}

TEST_F(FalconDeviceThreads, closeInMidLoadOfALostDeviceGivesTheLoadUp) {
  constexpr std::size_t kLong = 900'000;
  FalconOptions options;
  options.firmware_file = folder_.write("long.bin", std::string(kLong, 'f')).string();
  const auto device = opened(options);
  falcon_->unplug();
  ASSERT_TRUE(loopUntil(*device, [&] { return (reading_.condition & kDeviceLost) != 0; }));
  // the loading thread holds the fake's lock nearly always: a look at `loaded` might wait for the end of the
  // load
  std::atomic<bool> loads = false;
  with([&](FakeFalcon& f) {
    f.runs = false;
    f.on_load = [&] {
      loads = true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    };  // the whole load takes long
  });
  falcon_->plugIn();
  ASSERT_TRUE(loopUntil(*device, [&] { return loads.load(); }));
  device->close();
  EXPECT_LT(with([](FakeFalcon& f) { return f.loaded.size(); }), kLong);
}

}  // namespace
}  // namespace needlelab::falcon
