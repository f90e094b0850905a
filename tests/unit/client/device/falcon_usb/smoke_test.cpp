// The whole way from device `falcon` over libusb and usbfs to an emulated Falcon. These tests wait for events
// and bound no time: tests/bench/realtime measures rates and delays; the timing of torque, faults and
// reconnection is asserted on simulated time.
#include <filesystem>
#include <fstream>

#include "client/device/falcon/falcon_geometry.h"
#include "common/haptics/gate/force_gate.h"
#include "tests/support/run_form.h"
#include "tests/support/sanitized.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/client/device/falcon_usb/falcon_on_usb.h"

namespace needlelab::test {
namespace {

using FalconUsbSmoke = FalconOnUsb;

TEST_F(FalconUsbSmoke, bootsFindsItsZeroAndReportsPlaceAndButtons) {
  const TempFolder folder;
  FalconOptions with_file = options();
  with_file.firmware_file = folder.write("novint.bin", std::string(300, 'f'));
  falcon_.with([](FalconBoard& board, FtdiChip&, FalconGrip&) {
    board.forgetFirmware();
    board.firmware = Bytes(300, 'f');
  });
  openDevice(with_file);
  EXPECT_TRUE(falcon_.with([](FalconBoard& board, FtdiChip&, FalconGrip&) { return board.runs(); }));
  EXPECT_EQ(device_->read(reading_), DeviceRead::kNoUpdate) << "its encoders know no zero yet";
  home();
  EXPECT_EQ(reading_.condition & kDeviceNotReady, 0u);
  for (const Vec3 p_m : {Vec3{}, Vec3{0, 0.03, 0}, Vec3{-0.02, -0.02, 0.03}, Vec3{0.02, 0.01, -0.03}}) {
    falcon_.holdAt(p_m);
    EXPECT_TRUE(tickUntil([&] { return norm(reading_.X_WH.p - p_m) < 1e-4; })) << p_m.x << " " << p_m.y;
  }
  falcon_.with([](FalconBoard& board, FtdiChip&, FalconGrip&) { board.buttons = 0b0101; });
  EXPECT_TRUE(tickUntil([this] { return reading_.buttons == 0b0101u; }));
}

TEST_F(FalconUsbSmoke, theHandFeelsTheForceUntilTheHapticThreadFallsSilent) {
  openDevice();
  home();
  for (const Vec3 wanted_N : {Vec3{2.5, 0, 0}, Vec3{0, 2.5, 0}, Vec3{-1.5, 1.5, 1.2}})
    // motors round to units of 2.5 mN at the end of a thigh: far less than a percent
    EXPECT_TRUE(
        tickUntil([&] { return norm(falcon_.force_N() - wanted_N) < 0.01 * norm(wanted_N); }, wanted_N));
  EXPECT_TRUE(eventually([this] { return norm(falcon_.force_N()) == 0; })) << "no tick comes";
  EXPECT_TRUE(waitForFresh());

  EXPECT_TRUE(tickUntil([this] { return norm(falcon_.force_N()) > 1; }, {0, 0, 2}));
  device_->close();
  EXPECT_EQ(falcon_.heard().back().command, falcon::Command{});
  EXPECT_TRUE(eventually([this] { return falcon_.port().openClients() == 0; }));
}

std::size_t openFiles() {
  const std::filesystem::directory_iterator files("/proc/self/fd");
  return static_cast<std::size_t>(std::distance(begin(files), end(files)));
}

std::size_t residentKiB() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.rfind("VmRSS:", 0) == 0) return std::stoul(line.substr(6));
  return 0;
}

TEST_F(FalconUsbSmoke, unpluggedAndPluggedInAgainItReportsAndLeaksNothing) {
  const int rounds = longForm() ? 1000 : 12;
  openDevice();
  home();
  std::size_t files = 0, memory_KiB = 0;
  for (int round = 0; round < rounds; ++round) {
    if (round % 3 == 1) falcon_.hang(true);
    falcon_.unplug();
    ASSERT_TRUE(tickUntil([this] { return (reading_.condition & kDeviceLost) != 0; }))
        << "round " << round << ": its loss is not seen";
    if (round == 0) EXPECT_THAT(device_->status(), testing::HasSubstr("USB"));
    falcon_.hang(false);
    falcon_.plug();
    ASSERT_TRUE(waitForFresh()) << "round " << round << ": " << device_->status();
    // Memory that only the first rounds allocate is not a leak.
    if (round == 4) {
      files = openFiles();
      memory_KiB = residentKiB();
    }
  }
  EXPECT_TRUE(eventually([&] { return openFiles() <= files + 1; })) << openFiles() << " files, " << files;
  // We measured 136 KiB in 1000 rounds. A sanitizer holds back freed memory and finds leaks itself.
  EXPECT_TRUE(kSanitized || residentKiB() < memory_KiB + 2048) << residentKiB() - memory_KiB << " KiB";
  EXPECT_LE(falcon_.port().openClients(), 1);
}

}  // namespace
}  // namespace needlelab::test
