// Tests the emulated bootloader by plain libusb calls: its answers, and the inputs that it ignores.
#include <random>

#include "tests/unit/client/device/falcon_usb/libusb_host.h"

namespace needlelab::test {
namespace {

Bytes anyBytes(std::size_t count) {
  std::mt19937_64 random(7);
  Bytes bytes(count);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

class Bootloader : public testing::Test {
 protected:
  void SetUp() override {
    NEEDLELAB_NEEDS_EMULATED_USB(testbed_);
    falcon_.plug();
    host_ = std::make_unique<LibusbHost>();
    ASSERT_EQ(host_->open(), 0);
  }

  // up to the point where the bootloader accepts firmware
  void greet() {
    host_->settingsForBootloader();
    host_->write({0x0A, 0x43, 0x0D});
    ASSERT_EQ(host_->read(4), (Bytes{0x0A, 0x44, 0x2C, 0x0D}));
    host_->request(1, 0x0100);  // DTR low
    host_->request(3, 0xC015);  // 3 MHz / 21.125
    host_->write({0x41});
    ASSERT_EQ(host_->read(1), (Bytes{0x41}));
  }

  const Bytes firmware_ = anyBytes(1000);
  UsbTestbed testbed_;
  FalconEmulator falcon_{testbed_, {"FALCON01", firmware_, false}};
  std::unique_ptr<LibusbHost> host_;
};

TEST_F(Bootloader, takesTheFirmwareInChunksAndStartsIt) {
  greet();
  for (std::size_t at = 0; at < firmware_.size(); at += 62) {
    const Bytes chunk(firmware_.begin() + static_cast<std::ptrdiff_t>(at),
                      firmware_.begin() + static_cast<std::ptrdiff_t>(std::min(firmware_.size(), at + 62)));
    host_->write(chunk);
    ASSERT_EQ(host_->read(chunk.size()), chunk) << at;
  }
  host_->settingsForFirmware();
  host_->write(packetOf({0, 0, 0}, 0));
  EXPECT_TRUE(answerOf(host_->read(16)).has_value());
  EXPECT_EQ(falcon_.mode(), FalconBoard::Mode::kRuns);
}

TEST_F(Bootloader, staysSilentToAnotherImage) {
  greet();
  host_->write({1, 2, 3});
  host_->read(3);
  host_->settingsForFirmware();
  host_->write(packetOf({0, 0, 0}, 0));
  EXPECT_TRUE(host_->read(1, std::chrono::milliseconds(50)).empty());
  EXPECT_NE(falcon_.silentBecause().find("not this device's firmware"), std::string::npos);
}

TEST_F(Bootloader, staysSilentAtAnotherBaudRate) {
  host_->settingsForBootloader();
  host_->request(3, 0x001A);  // 115200
  host_->write({0x0A, 0x43, 0x0D});
  EXPECT_TRUE(host_->read(1, std::chrono::milliseconds(50)).empty());
  EXPECT_NE(falcon_.silentBecause().find("baud rate"), std::string::npos);
}

TEST_F(Bootloader, staysSilentWithoutAReset) {
  host_->request(0, 0);
  host_->request(3, 0x4138);
  host_->request(4, 8);
  host_->write({0x0A, 0x43, 0x0D});
  EXPECT_TRUE(host_->read(1, std::chrono::milliseconds(50)).empty());
  EXPECT_NE(falcon_.silentBecause().find("DTR"), std::string::npos);
}

TEST_F(Bootloader, staysSilentToASecondWordWithDtrHigh) {
  host_->settingsForBootloader();
  host_->write({0x0A, 0x43, 0x0D});
  host_->read(4);
  host_->request(3, 0xC015);
  host_->write({0x41});
  EXPECT_TRUE(host_->read(1, std::chrono::milliseconds(50)).empty());
  EXPECT_EQ(falcon_.silentBecause(), "DTR is still high");
}

TEST(FtdiBaud, isThreeMegahertzOverEighths) {
  EXPECT_DOUBLE_EQ(baudOf(0x4138, 0), 9600);
  EXPECT_DOUBLE_EQ(baudOf(0xC015, 0), 3e6 / 21.125);
  EXPECT_DOUBLE_EQ(baudOf(0x0015, 1), 3e6 / 21.375);
  EXPECT_DOUBLE_EQ(baudOf(2, 0), 1.5e6);
  EXPECT_DOUBLE_EQ(baudOf(0, 0), 3e6);
}

}  // namespace
}  // namespace needlelab::test
