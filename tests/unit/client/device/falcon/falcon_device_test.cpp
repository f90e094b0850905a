// The Falcon as a Device, in simulated time; at the end with real threads, for ThreadSanitizer. Faults are
// tested in tests/unit/client/device/world/falcon_faults_test.cpp.
#include <gmock/gmock.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <thread>

#include "client/device/falcon/falcon_device.h"
#include "client/device/falcon/falcon_geometry.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/support/falcon_emulator/direct_link.h"
#include "tests/support/realtime/no_alloc.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/device_world.h"

namespace needlelab::falcon {
namespace {

using test::DirectFalcon;
using test::Motors;
using testing::HasSubstr;

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
    options.priority = 0;
    return std::make_unique<FalconDevice>(std::move(options), DirectFalcon::bus(falcon_, time_), time_,
                                          threads_);
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
  bool loopUntilTorque(FalconDevice& device) {
    return loopUntil(
        device, [&] { return falcon_->last().motor != Motors{}; }, guarded({3, 0, 0}));
  }
  bool loopUntilLost(FalconDevice& device) {
    return loopUntil(device, [&] { return (reading_.condition & kDeviceLost) != 0; });
  }
  FalconOptions withFirmware(std::size_t bytes = 5000) {
    FalconOptions options;
    options.firmware_file = folder_.write("fw.bin", std::string(bytes, 'f')).string();
    return options;
  }

  test::DeviceWorld world_;
  TimeSource& time_;
  TurnRunner& threads_;
  std::shared_ptr<DirectFalcon> falcon_ = std::make_shared<DirectFalcon>();
  test::TempFolder folder_;
  DeviceReading reading_;
  DeviceRead last_ = DeviceRead::kNoUpdate;
};

TEST_F(FalconDeviceTest, placeOfTheGripInWAndItsButtons) {
  falcon_->encoder = encodersAt({0.02, -0.01, 0.115});
  falcon_->buttons = 0b0110;
  const auto device = opened();
  ASSERT_TRUE(loopUntilFresh(*device));
  // X toward the user from the middle at 125 mm, Y to the right, Z up; an encoder step is about 0.03 mm
  EXPECT_LT(norm(reading_.X_WH.p - Vec3{-0.010, 0.020, -0.010}), 5e-5);
  EXPECT_EQ(reading_.X_WH.q, Quat{});
  EXPECT_EQ(reading_.buttons, 0b0110u);
  EXPECT_EQ(reading_.condition, 0u);
  EXPECT_EQ(reading_.speed_mps, 0);
  EXPECT_EQ(device->clampedTicks(), 0u);
}

TEST_F(FalconDeviceTest, motorsDoTheWorkOfTheNewestForce) {
  const Vec3 p_F_m{0.015, 0.01, 0.13}, f_W_N{1.5, -0.7, 0.9};
  falcon_->encoder = encodersAt(p_F_m);
  const auto device = opened();
  ASSERT_TRUE(loopUntilFresh(*device));
  device->write(guarded({-3, 0, 0}));
  device->write(guarded(f_W_N));
  time_.sleepForNs(2 * test::kMs);
  const Motors motor = falcon_->last().motor;
  // the thigh's torque from its motor by published constants; the work of a small move from the inverse
  // kinematics
  const Vec3 p = forwardKinematics(anglesOfEncoders(encodersAt(p_F_m))).p_F_m;
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
    with([&](DirectFalcon& f) { f.encoder = encodersAt({0, 0, 0.11 + 0.2e-3 * ms}); });
    time_.sleepForNs(test::kMs);
    ASSERT_EQ(device->read(reading_), DeviceRead::kFresh);
    // over eight reports; an encoder step is about 0.03 mm
    if (ms > 20) {
      ASSERT_NEAR(reading_.speed_mps, 0.2, 0.006) << ms;
    }
  }
}

TEST_F(FalconDeviceTest, closeSendsZeroTorqueLastAndTheDeviceReopens) {
  const auto device = make();
  for (const double rate_hz : {1000.0, 500.0, 1000.0}) {
    ASSERT_TRUE(device->open(rate_hz).ok());
    ASSERT_TRUE(loopUntilTorque(*device));
    device->close();
    EXPECT_EQ(falcon_->last(), (Command{{}, 0}));
    EXPECT_EQ(falcon_->open_links, 0);
    device->close();
    EXPECT_NE(device->read(reading_), DeviceRead::kFinished) << "a late tick does no harm";
    device->write(guarded({1, 0, 0}));
  }
}

TEST_F(FalconDeviceTest, firmwareIsLoadedOnceWithReportedProgress) {
  falcon_->forgetFirmware();
  FalconOptions options = withFirmware();
  std::vector<std::string> progress;
  options.progress = [&](const std::string& words) { progress.push_back(words); };
  const auto device = opened(options);
  EXPECT_EQ(falcon_->loaded, test::Bytes(5000, 'f'));
  ASSERT_GE(progress.size(), 10u);
  EXPECT_THAT(progress.front(), HasSubstr("0 %"));
  EXPECT_THAT(progress.back(), HasSubstr("100 %"));
  device->close();
  ASSERT_TRUE(device->open(1000).ok());
  EXPECT_EQ(falcon_->loads, 1) << "it runs already";
  device->close();

  falcon_->forgetFirmware();
  ::setenv("NEEDLELAB_FALCON_FIRMWARE", options.firmware_file.c_str(), 1);
  const auto by_environment = opened();
  ::unsetenv("NEEDLELAB_FALCON_FIRMWARE");
  EXPECT_EQ(falcon_->loads, 2);
}

TEST_F(FalconDeviceTest, replugWithoutFirmwareFileIsReported) {
  const auto device = opened();
  falcon_->unplug();
  ASSERT_TRUE(loopUntilLost(*device));
  falcon_->forgetFirmware();
  falcon_->plugIn();
  ASSERT_TRUE(loopUntil(
      *device, [&] { return device->status().find("NEEDLELAB_FALCON_FIRMWARE") != std::string::npos; }));
  EXPECT_EQ(reading_.condition & kDeviceLost, kDeviceLost);
}

TEST_F(FalconDeviceTest, errorsOfOpenSayWhatToDoAndLeaveNothingOpen) {
  FalconOptions nowhere;
  nowhere.firmware_file = "/nowhere/fw.bin";
  const struct {
    double rate_hz;
    bool plugged, runs, deaf, bad_echo;
    FalconOptions options;
    ErrorCode code;
    const char* words;
  } rows[] = {
      {1001, true, true, false, false, {}, ErrorCode::kInvalidInput, "rate in Hz"},
      {std::nan(""), true, true, false, false, {}, ErrorCode::kInvalidInput, "rate in Hz"},
      {0, true, true, false, false, {}, ErrorCode::kInvalidInput, "rate in Hz"},
      {1000, false, true, false, false, {}, ErrorCode::kNotFound, "USB cable"},
      {1000, true, false, false, false, {}, ErrorCode::kInvalidInput, "falcon:FILE"},
      {1000, true, false, false, false, nowhere, ErrorCode::kNotFound, "/nowhere/fw.bin"},
      {1000, true, false, true, false, withFirmware(), ErrorCode::kUnavailable, "power supply"},
      {1000, true, false, false, true, withFirmware(), ErrorCode::kCorrupt, "byte 100"},
  };
  for (const auto& row : rows) {
    falcon_ = std::make_shared<DirectFalcon>();
    falcon_->plugged = row.plugged;
    falcon_->silent = row.deaf;
    if (!row.runs) falcon_->forgetFirmware();
    if (row.bad_echo) falcon_->echo_wrong = 100;
    const Status done = make(row.options)->open(row.rate_hz);
    ASSERT_FALSE(done.ok()) << row.words;
    EXPECT_EQ(done.error().code, row.code) << row.words;
    EXPECT_THAT(done.error().message, HasSubstr(row.words));
    EXPECT_EQ(falcon_->open_links, 0);
    EXPECT_EQ(falcon_->loads, row.bad_echo ? 3 : 0) << "a bad load is tried again";
  }
}

TEST_F(FalconDeviceTest, hapticSideUsesNoHeapInGoodAndBadTimes) {
  const auto device = opened();
  ForceGate gate(device->info().limits, 1000);
  std::uint64_t calls = 0, fresh = 0;
  std::uint32_t seen = 0;
  const auto loop = [&](int ticks) {
    for (int i = 0; i < ticks; ++i) {
      {
        const test::NoAllocScope scope;
        const bool is_fresh = device->read(reading_) == DeviceRead::kFresh;
        TipSample tip;
        tip.p_WT_m = reading_.X_WH.p;
        gate.admit(tip, is_fresh, reading_.speed_mps);
        device->write(gate.guard({{2, 1, 0}, {}}));
        device->skip(1);
        calls += scope.calls();
        fresh += is_fresh ? 1 : 0;
        seen |= reading_.condition;
      }
      world_.sleepForNs(test::kMs);
    }
  };
  loop(200);
  EXPECT_EQ(fresh, 200u);
  falcon_->homed = 0;
  loop(100);
  falcon_->homed = 0x70;
  falcon_->garbage = true;
  loop(200);
  falcon_->garbage = false;
  falcon_->unplug();
  loop(100);
  falcon_->plugIn();
  loop(300);
  EXPECT_EQ(seen & (kDeviceNotReady | kDeviceTrouble | kDeviceLost),
            kDeviceNotReady | kDeviceTrouble | kDeviceLost);
  EXPECT_EQ(calls, 0u);
}

TEST(FalconSpec, whatFollowsTheKind) {
  const struct {
    const char *rest, *file, *which;
  } rows[] = {{"", "", ""},
              {"@1-4.2", "", "1-4.2"},
              {":fw.bin", "fw.bin", ""},
              {":/opt/falcon@home/fw.bin@FT12", "/opt/falcon@home/fw.bin", "FT12"},
              {":/opt/falcon@home/fw.bin", "/opt/falcon@home/fw.bin", ""}};
  for (const auto& row : rows) {
    EXPECT_EQ(falconOptions(row.rest)->firmware_file, row.file);
    EXPECT_EQ(falconOptions(row.rest)->which, row.which);
  }
  for (const char* bad : {":", "@", ":@1-2", ":fw.bin@", "x"})
    EXPECT_EQ(falconOptions(bad).ok() ? ErrorCode::kFailed : falconOptions(bad).error().code,
              ErrorCode::kInvalidInput)
        << bad;
}

// ---- real threads, without time limits

class FalconDeviceThreads : public FalconDeviceTest {
 protected:
  FalconDeviceThreads() : FalconDeviceTest(false) {}
};

TEST_F(FalconDeviceThreads, opensRendersIsLostComesBackAndCloses) {
  const auto device = opened();
  for (int round = 0; round < 3; ++round) {
    ASSERT_TRUE(loopUntilTorque(*device));
    falcon_->unplug();
    ASSERT_TRUE(loopUntilLost(*device));
    falcon_->plugIn();
    ASSERT_TRUE(loopUntilFresh(*device));
  }
  device->close();
  EXPECT_EQ(falcon_->last(), (Command{{}, 0}));
  EXPECT_EQ(with([](DirectFalcon& f) { return f.open_links; }), 0);
}

TEST_F(FalconDeviceThreads, closeInMidLoadOfALostDeviceGivesTheLoadUp) {
  constexpr std::size_t kLong = 900'000;
  const auto device = opened(withFirmware(kLong));
  falcon_->unplug();
  ASSERT_TRUE(loopUntilLost(*device));
  // the loading thread holds the board's lock almost always: reading `loaded` might wait for the end of the
  // load
  std::atomic<bool> loads = false;
  with([&](DirectFalcon& f) {
    f.forgetFirmware();
    f.on_write = [&] {
      loads = f.loads > 0;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    };  // during the whole load
  });
  falcon_->plugIn();
  ASSERT_TRUE(loopUntil(*device, [&] { return loads.load(); }));
  device->close();
  EXPECT_LT(with([](DirectFalcon& f) { return f.loaded.size(); }), kLong);
}

}  // namespace
}  // namespace needlelab::falcon
