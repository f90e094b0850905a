// Tests how the device `falcon` is found over USB. Nothing here depends on the machine's speed.
#include <sys/types.h>
#include <unistd.h>

#include <filesystem>

#include "tests/unit/client/device/falcon_usb/falcon_on_usb.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

using FalconUsbFound = FalconOnUsb;

Error refusal(const FalconOptions& options) {
  const Status opened = FalconDevice(options).open(1000);
  EXPECT_FALSE(opened.ok());
  return opened.ok() ? Error{} : opened.error();
}

TEST_F(FalconUsbFound, noneIsListedInWords) {
  const auto found = listFalcons();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_FALSE(found[0].ready);
  EXPECT_THAT(found[0].state, HasSubstr("USB cable"));
  EXPECT_EQ(refusal(options()).code, ErrorCode::kNotFound);
}

TEST_F(FalconUsbFound, oneIsListedWithItsSerialNumber) {
  falcon_.plug();
  const auto found = listFalcons();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_TRUE(found[0].ready) << found[0].state;
  EXPECT_EQ(found[0].spec, "falcon");
  EXPECT_THAT(found[0].name, HasSubstr("FALCON01"));
  EXPECT_EQ(falcon_.heard().size(), 0u) << "listing moves nothing";
}

TEST_F(FalconUsbFound, ofTwoOneIsChosenAndTheyDoNotDisturbEachOther) {
  FalconEmulator second{testbed_, "FALCON02"};
  falcon_.plug();
  second.plug();
  const auto found = listFalcons();
  EXPECT_EQ(found.size(), 2u);
  const Error any = refusal(options());
  EXPECT_EQ(any.code, ErrorCode::kInvalidInput);
  EXPECT_THAT(any.message, HasSubstr("falcon@"));
  EXPECT_EQ(refusal(options("FALCON03")).code, ErrorCode::kNotFound);

  FalconDevice other(options("FALCON02"));
  ASSERT_TRUE(other.open(1000).ok());
  EXPECT_TRUE(eventually([&] { return second.heard().size() > 10; }));
  EXPECT_EQ(falcon_.heard().size(), 0u);
  openDevice(options("FALCON01"));
  second.with([](FalconBoard& board, FtdiChip&, FalconGrip&) { board.buttons = 4; });
  DeviceReading read_of_other;
  EXPECT_TRUE(tickUntil([&] {
    other.read(read_of_other);
    return read_of_other.buttons == 4;
  }));
  EXPECT_EQ(reading_.buttons, 0u);
  device_->close();
  other.close();

  for (const FoundDevice& one : found) {
    ASSERT_EQ(one.spec.rfind("falcon@", 0), 0u) << one.spec;
    EXPECT_TRUE(FalconDevice(options(one.spec.substr(7))).open(1000).ok()) << one.spec;
  }
}

TEST_F(FalconUsbFound, missingRightsNameWhoMustGrantThem) {
  falcon_.plug();
  falcon_.port().setMode(0);
  // Root may open any device, so change to another user for this test.
  std::filesystem::permissions(testbed_.root(), std::filesystem::perms::all);
  for (const auto& file : std::filesystem::recursive_directory_iterator(testbed_.root() + "/ioctl"))
    std::filesystem::permissions(file.path(), std::filesystem::perms::all);
  const bool root = ::geteuid() == 0;
  ASSERT_EQ(::seteuid(root ? 65534 : ::geteuid()), 0);
  const Error error = refusal(options());
  const auto found = listFalcons();
  ASSERT_EQ(::seteuid(root ? 0 : ::geteuid()), 0);
  EXPECT_EQ(error.code, ErrorCode::kDenied) << error.message;
  EXPECT_THAT(error.message, HasSubstr("udev"));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_FALSE(found[0].ready);
}

TEST_F(FalconUsbFound, useByAnotherProgramIsReported) {
  falcon_.port().setBusy(true);
  falcon_.plug();
  const Error error = refusal(options());
  EXPECT_EQ(error.code, ErrorCode::kUnavailable);
  EXPECT_THAT(error.message, HasSubstr("another program"));
  EXPECT_FALSE(listFalcons()[0].ready);
  // it is busy while we use it
  falcon_.port().setBusy(false);
  openDevice();
  EXPECT_THAT(refusal(options()).message, HasSubstr("another program"));
}

TEST_F(FalconUsbFound, theKernelsDriverMakesRoomAndComesBack) {
  falcon_.port().setKernelDriver("ftdi_sio");
  falcon_.plug();
  EXPECT_TRUE(falcon_.port().kernelDriverAttached());
  openDevice();
  EXPECT_FALSE(falcon_.port().kernelDriverAttached());
  device_->close();
  EXPECT_TRUE(falcon_.port().kernelDriverAttached());
}

// the bus is notified of an arrival and does not wait for its next poll
TEST_F(FalconUsbFound, itsArrivalIsSeen) {
  const auto bus = falcon::makeUsbBus();
  EXPECT_FALSE(bus->open("").ok());
  for (int round = 0; round < 3; ++round) {
    falcon_.plug();
    const std::int64_t end_ns = machineTime().nowNs() + std::chrono::nanoseconds(kPatience).count();
    bus->waitForArrival(end_ns);
    EXPECT_LT(machineTime().nowNs(), end_ns) << round;
    EXPECT_TRUE(bus->open("").ok());
    falcon_.unplug();
    EXPECT_TRUE(eventually([&] { return !bus->open("").ok(); }));
  }
}

}  // namespace
}  // namespace needlelab::test
