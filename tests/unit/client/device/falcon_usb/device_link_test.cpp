// Tests how the device `falcon` is found and loaded over USB. Nothing here depends on how fast the machine
// is.
#include <sys/types.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "tests/support/temp_folder.h"
#include "tests/unit/client/device/falcon_usb/falcon_on_usb.h"

namespace needlelab::test {
namespace {

// --- found -----------------------------------------------------------------------------------------------

TEST_F(FalconOnUsb, noneIsListedInWords) {
  const auto found = listFalcons();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_FALSE(found[0].ready);
  EXPECT_NE(found[0].state.find("USB cable"), std::string::npos);
  FalconDevice device{FalconOptions{}};
  const Status opened = device.open(1000);
  ASSERT_FALSE(opened.ok());
  EXPECT_EQ(opened.error().code, ErrorCode::kNotFound);
}

TEST_F(FalconOnUsb, oneIsListedWithItsSerialNumber) {
  falcon_.plug();
  const auto found = listFalcons();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_TRUE(found[0].ready) << found[0].state;
  EXPECT_EQ(found[0].spec, "falcon");
  EXPECT_NE(found[0].name.find("FALCON01"), std::string::npos) << found[0].name;
  EXPECT_EQ(falcon_.commands(), 0u) << "listing moves nothing";
}

TEST_F(FalconOnUsb, ofTwoOneIsChosenBySerialNumberOrPath) {
  FalconEmulator second{testbed_, {.serial = "FALCON02", .firmware = {}}};
  falcon_.plug();
  second.plug();
  EXPECT_EQ(listFalcons().size(), 2u);

  FalconDevice any{FalconOptions{}};
  const Status opened = any.open(1000);
  ASSERT_FALSE(opened.ok());
  EXPECT_EQ(opened.error().code, ErrorCode::kInvalidInput);
  EXPECT_NE(opened.error().message.find("falcon@"), std::string::npos) << opened.error().message;

  FalconOptions unknown;
  unknown.which = "FALCON03";
  EXPECT_EQ(FalconDevice(unknown).open(1000).error().code, ErrorCode::kNotFound);

  FalconOptions chosen;
  chosen.which = "FALCON02";
  FalconDevice device(chosen);
  ASSERT_TRUE(device.open(1000).ok());
  EXPECT_TRUE(waitUntil([&] { return second.commands() > 10; }));
  EXPECT_EQ(falcon_.commands(), 0u);
  device.close();

  for (const FoundDevice& found : listFalcons()) {
    ASSERT_EQ(found.spec.rfind("falcon@", 0), 0u) << found.spec;
    FalconOptions by_path;
    by_path.which = found.spec.substr(7);
    FalconDevice one(by_path);
    EXPECT_TRUE(one.open(1000).ok()) << found.spec;
  }
  EXPECT_GT(falcon_.commands(), 0u);
}

TEST_F(FalconOnUsb, twoAtOnceDoNotDisturbEachOther) {
  FalconEmulator second{testbed_, {.serial = "FALCON02", .firmware = {}}};
  second.plug();
  FalconOptions first_options, second_options;
  first_options.which = "FALCON01";
  second_options.which = "FALCON02";
  openDevice(first_options);
  FalconDevice other(second_options);
  ASSERT_TRUE(other.open(1000).ok());
  second.setButtons(4);
  DeviceReading read_of_other;
  EXPECT_TRUE(runTicks([&] {
    device_->read(reading_);
    other.read(read_of_other);
    return read_of_other.buttons != 4;
  }));
  EXPECT_EQ(reading_.buttons, 0u);
}

TEST_F(FalconOnUsb, withoutRightsItSaysWhoMustGiveThem) {
  falcon_.plug();
  falcon_.port().setMode(0);
  // Root may open any device, so change to another user for this test.
  std::filesystem::permissions(testbed_.root(), std::filesystem::perms::all);
  for (const auto& file : std::filesystem::recursive_directory_iterator(testbed_.root() + "/ioctl"))
    std::filesystem::permissions(file.path(), std::filesystem::perms::all);
  const bool root = ::geteuid() == 0;
  ASSERT_EQ(::seteuid(root ? 65534 : ::geteuid()), 0);
  FalconDevice device{FalconOptions{}};
  const Status opened = device.open(1000);
  const auto found = listFalcons();
  ASSERT_EQ(::seteuid(root ? 0 : ::geteuid()), 0);
  ASSERT_FALSE(opened.ok());
  EXPECT_EQ(opened.error().code, ErrorCode::kDenied) << opened.error().message;
  EXPECT_NE(opened.error().message.find("udev"), std::string::npos) << opened.error().message;
  ASSERT_EQ(found.size(), 1u);
  EXPECT_FALSE(found[0].ready);
}

TEST_F(FalconOnUsb, usedByAnotherProgramItSaysSo) {
  falcon_.port().setBusy(true);
  falcon_.plug();
  FalconDevice device{FalconOptions{}};
  const Status opened = device.open(1000);
  ASSERT_FALSE(opened.ok());
  EXPECT_EQ(opened.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(opened.error().message.find("another program"), std::string::npos) << opened.error().message;
  EXPECT_FALSE(listFalcons()[0].ready);
}

TEST_F(FalconOnUsb, theKernelsDriverMakesRoomAndComesBack) {
  falcon_.port().setKernelDriver("ftdi_sio");
  openDevice();
  EXPECT_FALSE(falcon_.port().kernelDriverAttached());
  device_->close();
  EXPECT_TRUE(falcon_.port().kernelDriverAttached());
}

TEST_F(FalconOnUsb, aRateThatItCannotKeepIsRefused) {
  falcon_.plug();
  FalconDevice device{FalconOptions{}};
  EXPECT_EQ(device.open(2000).error().code, ErrorCode::kInvalidInput);
}

// --- loaded ------------------------------------------------------------------------------------------------

class FalconFirmware : public FalconOnUsb {
 protected:
  // A device that accepts only the bytes of `firmware_`.
  static constexpr std::size_t kBytes = 62 * 6 + 20;
  FalconOptions fileWith(const Bytes& bytes) {
    const auto path = folder_.path() / "novint.bin";
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    FalconOptions options;
    options.firmware_file = path.string();
    return options;
  }
  Error failure(const FalconOptions& options) {
    bare_.plug();
    FalconDevice device(options);
    const Status opened = device.open(1000);
    EXPECT_FALSE(opened.ok());
    return opened.ok() ? Error{} : opened.error();
  }

  TempFolder folder_;
  const Bytes firmware_ = anyBytes(kBytes, 11);
  FalconEmulator bare_{testbed_, {.serial = "BARE", .firmware = firmware_, .firmware_running = false}};
};

TEST_F(FalconFirmware, isLoadedFromTheFile) {
  bare_.plug();
  FalconOptions options = fileWith(firmware_);
  std::vector<std::string> told;
  options.progress = [&told](const std::string& words) { told.push_back(words); };
  FalconDevice device(options);
  const Status opened = device.open(1000);
  ASSERT_TRUE(opened.ok()) << opened.error().message << "; device: " << bare_.silentBecause();
  EXPECT_EQ(bare_.mode(), FalconBoard::Mode::kRuns);
  EXPECT_FALSE(told.empty());
}

TEST_F(FalconFirmware, thatRunsIsNotLoadedAgain) {
  bare_.powerCycle(true);
  bare_.plug();
  FalconDevice device{FalconOptions{}};
  EXPECT_TRUE(device.open(1000).ok());
}

TEST_F(FalconFirmware, isAskedForWhenNoneIsNamed) {
  ::unsetenv("NEEDLELAB_FALCON_FIRMWARE");
  const Error error = failure({});
  EXPECT_EQ(error.code, ErrorCode::kInvalidInput);
  EXPECT_NE(error.message.find("NEEDLELAB_FALCON_FIRMWARE"), std::string::npos) << error.message;
}

TEST_F(FalconFirmware, comesFromTheEnvironmentToo) {
  ::setenv("NEEDLELAB_FALCON_FIRMWARE", fileWith(firmware_).firmware_file.c_str(), 1);
  bare_.plug();
  FalconDevice device{FalconOptions{}};
  ::unsetenv("NEEDLELAB_FALCON_FIRMWARE");
  EXPECT_TRUE(device.open(1000).ok());
}

TEST_F(FalconFirmware, thatIsNotThereIsNamed) {
  FalconOptions options;
  options.firmware_file = "/nowhere/novint.bin";
  const Error error = failure(options);
  EXPECT_EQ(error.code, ErrorCode::kNotFound);
  EXPECT_NE(error.message.find("/nowhere/novint.bin"), std::string::npos) << error.message;
}

TEST_F(FalconFirmware, thatIsEmptyIsRefused) {
  EXPECT_EQ(failure(fileWith({})).code, ErrorCode::kInvalidInput);
}

TEST_F(FalconFirmware, whoseEchoDiffersSaysAtWhichByte) {
  BoardTrouble trouble;
  trouble.echo_wrong_at = 100;
  bare_.setBoardTrouble(trouble);
  const Error error = failure(fileWith(firmware_));
  EXPECT_NE(error.message.find("100"), std::string::npos) << error.message;
  EXPECT_NE(error.message.find("novint.bin"), std::string::npos) << error.message;
}

TEST_F(FalconFirmware, whoseEchoStopsSaysAtWhichByte) {
  BoardTrouble trouble;
  trouble.echo_stops_at = 150;
  bare_.setBoardTrouble(trouble);
  const Error error = failure(fileWith(firmware_));
  EXPECT_NE(error.message.find("150"), std::string::npos) << error.message;
}

TEST_F(FalconFirmware, ofAnotherDeviceDoesNotAnswer) {
  const Error error = failure(fileWith(anyBytes(kBytes, 12)));
  EXPECT_NE(bare_.silentBecause().find("not this device's firmware"), std::string::npos)
      << bare_.silentBecause();
  EXPECT_NE(error.message.find("novint.bin"), std::string::npos) << error.message;
}

TEST_F(FalconFirmware, withoutPowerSaysSo) {
  BoardTrouble trouble;
  trouble.deaf = true;
  bare_.setBoardTrouble(trouble);
  const Error error = failure(fileWith(firmware_));
  EXPECT_EQ(error.code, ErrorCode::kUnavailable);
  EXPECT_NE(error.message.find("power"), std::string::npos) << error.message;
}

TEST_F(FalconFirmware, unpluggedInTheMiddleEndsTheLoading) {
  // With its cable in, this image would start; 20,000 bytes need 300 answers.
  const Bytes image = anyBytes(20'000, 13);
  FalconEmulator falcon{testbed_, {.serial = "LONG", .firmware = image, .firmware_running = false}};
  falcon.plug();
  FalconOptions options = fileWith(image);
  options.progress = [&falcon](const std::string&) { falcon.unplug(); };
  FalconDevice device(options);
  EXPECT_FALSE(device.open(1000).ok());
  EXPECT_NE(falcon.mode(), FalconBoard::Mode::kRuns);
}

}  // namespace
}  // namespace needlelab::test
