#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "client/device/falcon/firmware_loader.h"
#include "tests/support/falcon_emulator/direct_link.h"
#include "tests/support/temp_folder.h"
#include "tests/support/time/fake_time.h"

namespace needlelab::falcon {
namespace {

using test::Bytes;
using test::DirectFalcon;
using testing::HasSubstr;

Bytes someFirmware(std::size_t size) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(31 * i + (i >> 8));
  return bytes;
}

class FirmwareLoaderTest : public testing::Test {
 protected:
  void SetUp() override { falcon_->forgetFirmware(); }

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

  std::shared_ptr<DirectFalcon> falcon_ = std::make_shared<DirectFalcon>();
  test::FakeTime time_;
  test::DirectLink link_{falcon_, time_};
  int steps_ = 0;
  std::int64_t took_ms_ = 0;
};

TEST_F(FirmwareLoaderTest, everyByteArrivesForAnySizeOfTheFile) {
  for (const std::size_t size : {1u, 61u, 62u, 63u, 124u, 1000u, 40'000u}) {
    falcon_->firmware = someFirmware(size);
    const Status done = load(falcon_->firmware);
    ASSERT_TRUE(done.ok()) << size << ": " << done.error().message << "; " << falcon_->silent_because;
    EXPECT_TRUE(falcon_->runs());
    // line, greet, speed up, knock, chunks, run, first word
    EXPECT_EQ(steps_, 6 + static_cast<int>((size + 61) / 62));
    falcon_->forgetFirmware();
  }
}

TEST_F(FirmwareLoaderTest, requestsAreThoseOfTheFactsInTheirOrder) {
  ASSERT_TRUE(load(someFirmware(100)).ok());
  test::Requests seen = falcon_->requests;
  ASSERT_GE(seen.size(), 17u);
  seen.resize(17);
  // 9600: divisor 312.5 = 0x138, half coded 1 at bit 14; 140000: 21.375 = 0x15, 3/8 coded 4: bit 16 is in the
  // index; 1456312: 2
  const test::Requests facts = {
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
  for (double baud = 300; baud < 1.4e6; baud *= 1.07) {
    const BaudDivisor divisor = baudDivisor(baud);
    EXPECT_LT(std::abs(divisor.baud / baud - 1), 0.034) << baud;
    EXPECT_DOUBLE_EQ(test::baudOf(divisor.value, divisor.index), divisor.baud) << "as the chip reads it";
  }
}

TEST_F(FirmwareLoaderTest, failuresAreReportedInTime) {
  const Bytes image = someFirmware(300);
  const auto byteText = [&](std::size_t at) {
    return fmt::format(
        "sending the firmware: byte {0} (0x{0:X}) of 'fw.bin', 0x{1:02X}, came back as 0x{2:02X}", at,
        image[at], image[at] ^ 0x10);
  };
  struct Row {
    std::function<void(DirectFalcon&)> wrong;
    std::string words;
    std::int64_t took_ms;
  };
  std::vector<Row> rows = {
      {[](DirectFalcon& f) { f.echo_missing = 200; }, "byte 200 (0xC8) of 'fw.bin'", 1'000},
      {[](DirectFalcon& f) { f.echo_missing = 200; }, "did not come back within 1 s", 1'000},
      {[](DirectFalcon& f) { f.silent = true; },
       "greeting its loader: its greeting 0A 43 0D was answered by nothing instead of 0A 44 2C 0D", 1'000},
      {[](DirectFalcon& f) { f.silent = true; }, "power supply", 1'000},
      {[](DirectFalcon& f) {
         f.on_loaded_byte = [&f](std::size_t place) { f.plugged = f.plugged && place != 130; };
       },
       "unplugged", 0},
      {[](DirectFalcon& f) { f.firmware = someFirmware(301); }, "no firmware answers", 1'000},
  };
  for (const std::size_t at : {0u, 61u, 62u, 150u, 299u})
    rows.push_back({[at](DirectFalcon& f) { f.echo_wrong = at; }, byteText(at), 0});
  for (const Row& row : rows) {
    row.wrong(*falcon_);
    const Status done = load(image);
    ASSERT_FALSE(done.ok()) << row.words;
    EXPECT_EQ(done.error().code,
              falcon_->echo_wrong || falcon_->echo_missing ? ErrorCode::kCorrupt : ErrorCode::kUnavailable);
    EXPECT_THAT(done.error().message, HasSubstr(row.words));
    EXPECT_EQ(took_ms_, row.took_ms) << row.words;
    // the next load succeeds
    falcon_->echo_wrong.reset();
    falcon_->echo_missing.reset();
    falcon_->on_loaded_byte = nullptr;
    falcon_->silent = false;
    falcon_->plugged = true;
    falcon_->firmware.clear();
    EXPECT_TRUE(load(image).ok()) << row.words;
    falcon_->forgetFirmware();
  }
}

TEST_F(FirmwareLoaderTest, runningFirmwareIsRecognised) {
  auto runs = firmwareRuns(link_, 3, time_);
  ASSERT_TRUE(runs.ok());
  EXPECT_FALSE(*runs);
  falcon_->mode = test::FalconBoard::Mode::kRuns;
  runs = firmwareRuns(link_, 3, time_);
  ASSERT_TRUE(runs.ok());
  EXPECT_TRUE(*runs);
  EXPECT_EQ(falcon_->last().motor, test::Motors{}) << "asked with zero torque";
  EXPECT_EQ(falcon_->loads, 0);
  falcon_->plugged = false;
  EXPECT_FALSE(firmwareRuns(link_, 3, time_).ok());
}

TEST(FalconFirmwareFile, badFilesAreRefusedInWords) {
  const test::TempFolder folder;
  const struct {
    std::string file, words;
    ErrorCode code;
  } rows[] = {
      {folder.path() / "missing.bin", "cannot be read", ErrorCode::kNotFound},
      {folder.write("empty.bin", ""), "is empty", ErrorCode::kInvalidInput},
      {folder.write("huge.bin", std::string((1u << 20) + 1, 'x')), "longer than 1048576",
       ErrorCode::kInvalidInput},
  };
  for (const auto& row : rows) {
    EXPECT_EQ(readFirmware(row.file).error().code, row.code);
    EXPECT_THAT(readFirmware(row.file).error().message, HasSubstr(row.words));
  }
  EXPECT_FALSE(readFirmware(folder.path()).ok()) << "a folder";
  EXPECT_EQ(readFirmware(folder.write("good.bin", "firmware"))->size(), 8u);
}

// The simulated board rejects a host that deviates from the facts; otherwise the tests above would prove
// nothing.
TEST(FalconBoard, staysSilentToAHostThatDoesWrong) {
  const test::Requests hello = {{0, 1, 0}, {0, 2, 0},      {9, 16, 0},     {3, 0x4138, 0}, {4, 8, 0},
                                {2, 0, 0}, {1, 0x0200, 0}, {1, 0x0100, 0}, {1, 0x0101, 0}};
  const test::Requests go = {{1, 0x0100, 0}, {3, 0x0015, 1}}, run = {{3, 2, 0}};
  const struct {
    std::size_t part, request;  // this one …
    std::array<std::uint16_t, 3> instead;
    const char* because;
  } rows[] = {
      {9, 0, {}, ""},  // all correct
      {0, 0, {4, 8, 0}, "not purged"},
      {0, 1, {4, 8, 0}, "not purged"},
      {0, 2, {9, 1, 0}, "latency 1 ms"},
      {0, 3, {3, 0x001A, 0}, "not 9600"},
      {0, 4, {4, 7, 0}, "not 8N1"},
      {0, 5, {2, 0, 0x0100}, "flow control"},
      {0, 6, {1, 0x0202, 0}, "before DTR rose"},
      {0, 8, {1, 0x0100, 0}, "before DTR rose"},
      {1, 0, {1, 0x0101, 0}, "DTR is still high"},
      {1, 1, {3, 0x4138, 0}, "not 140000"},
      {2, 0, {3, 0x4138, 0}, "firmware neither"},
  };
  for (const auto& row : rows) {
    test::FalconBoard board;
    board.forgetFirmware();
    Bytes said;
    board.say = [&](std::uint8_t byte, std::int64_t) { said.push_back(byte); };
    const auto ask = [&](std::size_t part, const test::Requests& requests) {
      for (std::size_t i = 0; i < requests.size(); ++i) {
        const auto& [request, value, index] =
            part == row.part && i == row.request ? row.instead : requests[i];
        EXPECT_TRUE(board.request(static_cast<std::uint8_t>(request), value, index));
      }
    };
    ask(0, hello);
    board.receive(Bytes{0x0A, 0x43, 0x0D}, 0);
    if (!said.empty()) {
      ask(1, go);
      board.receive(Bytes{0x41}, 0);
    }
    if (said.size() == 4 + 1) {
      board.receive(Bytes{1, 2, 3}, 0);
      ask(2, run);
      board.receive(encodeCommand({}), 0);
    }
    EXPECT_THAT(board.silent_because, HasSubstr(row.because));
    EXPECT_EQ(board.runs(), row.part == 9) << row.because;
    EXPECT_EQ(said.size() == 4 + 1 + 3 + kPacketBytes, row.part == 9) << row.because;
  }
  test::FalconBoard board;
  EXPECT_FALSE(board.request(5, 0, 0)) << "no such request";
}

}  // namespace
}  // namespace needlelab::falcon
