#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "client/device/falcon/firmware_loader.h"
#include "tests/support/fake_falcon.h"
#include "tests/support/fake_time.h"
#include "tests/support/temp_folder.h"

namespace needlelab::falcon {
namespace {

using testing::HasSubstr;

Bytes someFirmware(std::size_t size) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(31 * i + (i >> 8));
  return bytes;
}

class FalconFirmware : public testing::Test {
 protected:
  void SetUp() override { falcon_->runs = false; }

  Status load(const Bytes& firmware) {
    const std::int64_t from_ns = time_.nowNs();
    FirmwareLoader loader(link_, firmware, "fw.bin", time_);
    steps_ = 1;
    while (loader.step()) ++steps_;
    EXPECT_EQ(loader.next(), loader.result().ok() ? LoadStep::kDone : LoadStep::kFailed);
    EXPECT_FALSE(loader.step()) << "over is over";
    took_ms_ = (time_.nowNs() - from_ns) / 1'000'000;
    return loader.result();
  }

  std::shared_ptr<FakeFalcon> falcon_ = std::make_shared<FakeFalcon>();
  test::FakeTime time_;
  FakeLink link_{falcon_, time_};
  int steps_ = 0;
  std::int64_t took_ms_ = 0;
};

TEST_F(FalconFirmware, everyByteArrivesForAnySizeOfTheFile) {
  for (const std::size_t size : {1u, 61u, 62u, 63u, 124u, 1000u, 40'000u}) {
    const Bytes firmware = someFirmware(size);
    const Status done = load(firmware);
    ASSERT_TRUE(done.ok()) << size << ": " << done.error().message;
    EXPECT_EQ(falcon_->loaded, firmware) << size;
    EXPECT_TRUE(falcon_->runs);
    // line, greet, speed up, knock, chunks, run, first word
    EXPECT_EQ(steps_, 6 + static_cast<int>((size + 61) / 62));
    falcon_->runs = false;
  }
}

TEST_F(FalconFirmware, requestsAreThoseOfTheFactsInTheirOrder) {
  falcon_->requests.clear();
  ASSERT_TRUE(load(someFirmware(100)).ok());
  Requests seen = falcon_->requests;
  ASSERT_GE(seen.size(), 17u);
  seen.resize(17);
  // 9600: divisor 312.5 = 0x138, half coded 1 at bit 14; 140000: 21.375 = 0x15, 3/8 coded 4: bit 16 is in the
  // index; 1456312: 2
  const Requests facts = {
      {0, 1, 0},      {0, 2, 0},      {9, 16, 0},                 // purge in and out, latency
      {3, 0x4138, 0}, {4, 8, 0},      {2, 0, 0},                  // 9600 8N1, no flow control
      {1, 0x0200, 0}, {1, 0x0100, 0}, {1, 0x0101, 0},             // RTS low, DTR low, high
      {1, 0x0100, 0}, {3, 0x0015, 1},                             // DTR low, 140000
      {9, 1, 0},      {4, 8, 0},      {2, 0, 0},      {3, 2, 0},  // latency, 8N1, no flow, 1456312
      {0, 1, 0},      {0, 2, 0},
  };
  EXPECT_EQ(seen, facts);
}

TEST(FalconBaudDivisor, isTheNearestThatTheChipCanMake) {
  EXPECT_DOUBLE_EQ(baudDivisor(9600).baud, 9600);
  EXPECT_NEAR(baudDivisor(140'000).baud, 140'350.9, 0.1);
  EXPECT_DOUBLE_EQ(baudDivisor(1'456'312).baud, 1.5e6);
  // a serial line tolerates about 3 %
  for (const double baud : {kGreetingBaud, kLoaderBaud, kRunBaud})
    EXPECT_LT(std::abs(baudDivisor(baud).baud / baud - 1), 0.031) << baud;
  for (double baud = 300; baud < 1.4e6; baud *= 1.07)
    EXPECT_LT(std::abs(baudDivisor(baud).baud / baud - 1), 0.034) << baud;
}

TEST_F(FalconFirmware, anEchoThatDiffersNamesTheByte) {
  for (const std::size_t at : {0u, 61u, 62u, 150u, 299u}) {
    falcon_->echo_wrong = at;
    const Bytes firmware = someFirmware(300);
    const Status done = load(firmware);
    ASSERT_FALSE(done.ok());
    EXPECT_EQ(done.error().code, ErrorCode::kCorrupt);
    char byte[96];
    std::snprintf(byte, sizeof byte, "byte %zu (0x%zX) of 'fw.bin', 0x%02X, came back as 0x%02X", at, at,
                  firmware[at], firmware[at] ^ 0x10);
    EXPECT_THAT(done.error().message, HasSubstr(byte));
    EXPECT_THAT(done.error().message, HasSubstr("sending the firmware"));
  }
}

TEST_F(FalconFirmware, anEchoThatDoesNotComeNamesTheByte) {
  falcon_->echo_missing = 200;
  const Status done = load(someFirmware(300));
  ASSERT_FALSE(done.ok());
  EXPECT_THAT(done.error().message, HasSubstr("byte 200 (0xC8) of 'fw.bin'"));
  EXPECT_THAT(done.error().message, HasSubstr("did not come back within 1 s"));
  EXPECT_EQ(took_ms_, 1'000);
}

TEST_F(FalconFirmware, noAnswerToTheGreetingSaysWhatToDo) {
  falcon_->silent = true;
  const Status done = load(someFirmware(10));
  ASSERT_FALSE(done.ok());
  EXPECT_EQ(took_ms_, 1'000);
  EXPECT_THAT(done.error().message, HasSubstr("greeting its loader"));
  EXPECT_THAT(done.error().message, HasSubstr("0A 43 0D was answered by nothing in place of 0A 44 2C 0D"));
  EXPECT_THAT(done.error().message, HasSubstr("power supply"));
}

TEST_F(FalconFirmware, unpluggedInMidLoadIsAnErrorAndNoWait) {
  falcon_->lost_at_byte = 130;
  const Status done = load(someFirmware(1000));
  ASSERT_FALSE(done.ok());
  EXPECT_THAT(done.error().message, HasSubstr("unplugged"));
  EXPECT_EQ(took_ms_, 0);
}

TEST_F(FalconFirmware, aFileThatDoesNotRunIsSaidThoughTheLoaderEchoes) {
  falcon_->starts = false;
  const Status done = load(someFirmware(1000));
  ASSERT_FALSE(done.ok());
  EXPECT_THAT(done.error().message, HasSubstr("no firmware answers"));
}

TEST_F(FalconFirmware, aSecondLoadAfterAFailedOneWorks) {
  falcon_->echo_wrong = 70;
  ASSERT_FALSE(load(someFirmware(200)).ok());
  falcon_->echo_wrong.reset();
  EXPECT_TRUE(load(someFirmware(200)).ok());
}

TEST_F(FalconFirmware, runningFirmwareIsRecognised) {
  auto runs = firmwareRuns(link_, 3, time_);
  ASSERT_TRUE(runs.ok());
  EXPECT_FALSE(*runs);
  falcon_->runs = true;
  runs = firmwareRuns(link_, 3, time_);
  ASSERT_TRUE(runs.ok());
  EXPECT_TRUE(*runs);
  EXPECT_EQ(falcon_->last().motor, (std::array<std::int16_t, 3>{})) << "asked with zero torque";
  EXPECT_EQ(falcon_->loads, 0);
  falcon_->plugged = false;
  EXPECT_FALSE(firmwareRuns(link_, 3, time_).ok());
}

TEST(FalconFirmwareFile, badFilesAreRefusedInWords) {
  const test::TempFolder folder;
  const std::string missing = folder.path() / "missing.bin", empty = folder.path() / "empty.bin",
                    huge = folder.path() / "huge.bin", good = folder.path() / "good.bin";
  std::ofstream(empty).flush();
  std::ofstream(huge) << std::string((1u << 20) + 1, 'x');
  std::ofstream(good) << "firmware";
  EXPECT_THAT(readFirmware(missing).error().message, HasSubstr("cannot be read"));
  EXPECT_EQ(readFirmware(missing).error().code, ErrorCode::kNotFound);
  EXPECT_THAT(readFirmware(empty).error().message, HasSubstr("is empty"));
  EXPECT_THAT(readFirmware(huge).error().message, HasSubstr("longer than 1048576"));
  EXPECT_FALSE(readFirmware(folder.path()).ok()) << "a folder";
  ASSERT_TRUE(readFirmware(good).ok());
  EXPECT_EQ(readFirmware(good)->size(), 8u);
}

}  // namespace
}  // namespace needlelab::falcon
