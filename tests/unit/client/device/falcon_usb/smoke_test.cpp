// The whole way from device `falcon` over libusb and usbfs to an emulated Falcon. These tests wait for what
// has to happen and bound no time: rates and delays are measured by tests/bench/realtime, and what has to
// happen when (torque, faults, reconnection) is asserted on simulated time.
#include <array>
#include <filesystem>
#include <fstream>

#include "client/device/falcon/falcon_geometry.h"
#include "common/haptics/device_condition.h"
#include "tests/support/run_form.h"
#include "tests/support/sanitized.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/device/falcon_usb/falcon_on_usb.h"

namespace needlelab::test {
namespace {

using Eigen::Vector3d;
constexpr std::array<std::int16_t, 3> kNoTorque{};

TEST_F(FalconOnUsb, bootsFindsItsZeroAndReportsPlaceAndButtons) {
  const TempFolder folder;
  const Bytes firmware = anyBytes(300, 5);
  FalconOptions options;
  options.firmware_file = folder.write("novint.bin", {reinterpret_cast<const char*>(firmware.data()), 300});
  falcon_.powerCycle(false);
  openDevice(options);
  EXPECT_EQ(falcon_.mode(), FalconBoard::Mode::kRuns);
  EXPECT_EQ(device_->read(reading_), DeviceRead::kNoUpdate) << "its encoders know no zero yet";
  home();
  EXPECT_EQ(reading_.condition & kDeviceNotReady, 0u);

  // the emulator's mechanics are computed apart from the driver's
  const double z = falcon::kOrigin_F_m.z;
  for (const Vector3d& p_F_m : {Vector3d(0, 0, z), Vector3d(0.03, 0, z), Vector3d(-0.02, 0.03, z - 0.02),
                                Vector3d(0.01, -0.03, z + 0.02)}) {
    falcon_.holdAt(p_F_m);
    EXPECT_TRUE(tickUntil([&] {
      const Vec3 p = falcon::pointToF(reading_.X_WH.p);
      return (Vector3d(p.x, p.y, p.z) - p_F_m).norm() < 1e-4;
    })) << p_F_m.transpose();
  }
  falcon_.setButtons(0b0101);
  EXPECT_TRUE(tickUntil([this] { return reading_.buttons == 0b0101u; }));
}

TEST_F(FalconOnUsb, theHandFeelsTheForceUntilTheHapticThreadFallsSilent) {
  openDevice();
  home();
  for (const Vec3 wanted : {Vec3{2.5, 0, 0}, Vec3{0, 2.5, 0}, Vec3{-1.5, 1.5, 1.2}}) {
    const Vec3 asked_F = falcon::vectorToF(wanted);
    const Vector3d asked(asked_F.x, asked_F.y, asked_F.z);
    // motors round to units of 2.5 mN at the end of a thigh: far below a percent
    EXPECT_TRUE(tickUntil([&] { return (falcon_.force() - asked).norm() < 0.01 * asked.norm(); }, wanted))
        << asked.transpose() << ", but " << falcon_.force().transpose();
  }
  EXPECT_TRUE(waitUntil([this] { return falcon_.force().norm() == 0; })) << "nobody ticks";
  EXPECT_TRUE(waitForFresh());

  EXPECT_TRUE(tickUntil([this] { return falcon_.force().norm() > 1; }, {0, 0, 2}));
  device_->close();
  EXPECT_EQ(falcon_.history().back().motors, kNoTorque);
  EXPECT_EQ(falcon_.force().norm(), 0);
  EXPECT_EQ(falcon_.lights(), 0u);
  EXPECT_TRUE(waitUntil([this] { return falcon_.port().openClients() == 0; }));
}

std::size_t openFiles() {
  std::size_t count = 0;
  for ([[maybe_unused]] const auto& file : std::filesystem::directory_iterator("/proc/self/fd")) ++count;
  return count;
}

std::size_t residentKiB() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.rfind("VmRSS:", 0) == 0) return std::stoul(line.substr(6));
  return 0;
}

TEST_F(FalconOnUsb, unpluggedAndPluggedInAgainItReportsAndLeaksNothing) {
  const int rounds = longForm() ? 1000 : 12;
  openDevice();
  home();
  std::size_t files = 0, memory_KiB = 0;
  for (int round = 0; round < rounds; ++round) {
    if (round % 3 == 1) {
      LineTrouble nak;  // with transfers that hang
      nak.nak_in = nak.nak_out = true;
      falcon_.setLineTrouble(nak);
    }
    falcon_.unplug();
    ASSERT_TRUE(tickUntil([this] { return (reading_.condition & kDeviceLost) != 0; }))
        << "round " << round << ": its loss is not seen";
    if (round == 0) {
      EXPECT_NE(device_->status().find("USB"), std::string::npos) << device_->status();
    }
    falcon_.setLineTrouble({});
    falcon_.plug();
    ASSERT_TRUE(waitForFresh()) << "round " << round << ": " << device_->status();
    // Memory that only the first rounds allocate is not a leak.
    if (round == 4) {
      files = openFiles();
      memory_KiB = residentKiB();
    }
  }
  EXPECT_TRUE(waitUntil([&] { return openFiles() <= files + 1; })) << openFiles() << " files, " << files;
  // We measured 136 KiB in 1000 rounds. A sanitizer holds back freed memory and finds leaks itself.
  EXPECT_TRUE(kSanitized || residentKiB() < memory_KiB + 2048) << residentKiB() - memory_KiB << " KiB";
  EXPECT_LE(falcon_.port().openClients(), 1);
}

}  // namespace
}  // namespace needlelab::test
