#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

#include "client/device/falcon/falcon_geometry.h"
#include "client/device/falcon/falcon_packet.h"
#include "tests/support/random.h"

namespace needlelab::falcon {
namespace {

Packet packet(std::string_view text) {
  EXPECT_EQ(text.size(), kPacketBytes);
  Packet bytes{};
  for (std::size_t i = 0; i < kPacketBytes; ++i) bytes[i] = static_cast<std::uint8_t>(text[i]);
  return bytes;
}

std::vector<Report> readAll(PacketReader& reader, std::string_view text) {
  std::vector<Report> reports;
  Report report;
  for (const char c : text)
    if (reader.push(static_cast<std::uint8_t>(c), report)) reports.push_back(report);
  return reports;
}

// written by hand from FACTS: nibble 0 is 'A', … 15 is 'P'; least significant nibble first
TEST(FalconPacket, torquesAndLightsAsTheDeviceWantsThem) {
  const struct {
    Command command;
    const char* text;
  } rows[] = {
      {{}, "<AAAAAAAAAAAAAA>"},
      // 0x0123 → 3 2 1 0 → D C B A; −1 → F F F F → P P P P; −4095 = 0xF001 → 1 0 0 F → B A A P
      // bits 1 + 4 (home, blue) = 5 → F
      {{{0x0123, -1, -4095}, kOutHome | kOutBlue}, "<DCBAPPPPBAAPFA>"},
      // beyond the motors' range it is clamped: 4095 = 0x0FFF → P P P A
      {{{32767, -32768, 4096}, 0}, "<PPPABAAPPPPAAA>"},
      // undefined bits are not sent
      {{{}, 0xF0}, "<AAAAAAAAAAAAAA>"},
  };
  for (const auto& row : rows) EXPECT_EQ(encodeCommand(row.command), packet(row.text)) << row.text;
}

TEST(FalconPacket, encodersButtonsAndZeros) {
  // −1600 = 0xF9C0 → 0 C 9 F → A M J P; 1 → B A A A; 0x7FFF → P P P H
  // buttons 0b1001 and all homed 0x70: 0x79 + 0x41 = 0xBA
  Report report;
  ASSERT_TRUE(decodeReport(packet("<AMJPBAAAPPPH\xBA\x41>"), report));
  EXPECT_EQ(report, (Report{{-1600, 1, 32767}, 0x79}));
}

TEST(FalconPacket, everyValueComesBack) {
  test::Random random(5);
  for (int n = 0; n < 70'000; ++n) {
    const auto any = [&] { return static_cast<std::int16_t>(65536 * random.unit() - 32768); };
    const Report report{{n < 65536 ? static_cast<std::int16_t>(n) : any(), any(), any()},
                        static_cast<std::uint8_t>(n & 0x7F)};
    Report back;
    ASSERT_TRUE(decodeReport(encodeReport(report), back));
    ASSERT_EQ(back, report);
  }
  Command back;
  const Command command{{-4095, 4095, 17}, kOutRed | kOutGreen};
  ASSERT_TRUE(decodeCommand(encodeCommand(command), back));
  EXPECT_EQ(back, command);
}

TEST(FalconPacket, everyByteOfEveryPlaceIsRightOrRefused) {
  const Packet good = encodeReport({{-1600, 77, 1234}, 0x35});
  for (std::size_t place = 0; place < kPacketBytes; ++place)
    for (int value = 0; value < 256; ++value) {
      Packet bent = good;
      bent[place] = static_cast<std::uint8_t>(value);
      bool allowed = false;
      if (place == 0) allowed = value == '<';
      if (place >= 1 && place <= 12) allowed = value >= 'A' && value <= 'P';
      if (place == 13) allowed = value >= 0x41 && value <= 0x41 + 0x7F;
      if (place == 14) allowed = true;
      if (place == 15) allowed = value == '>';
      Report report{{1, 2, 3}, 4};
      ASSERT_EQ(decodeReport(bent, report), allowed) << place << " " << value;
      // A refused packet changes nothing; an accepted packet returns its content.
      if (!allowed) {
        ASSERT_EQ(report, (Report{{1, 2, 3}, 4}));
      } else if (place != 14) {
        ASSERT_EQ(encodeReport(report)[place], value);
      }
    }
}

TEST(FalconPacketReader, findsPacketsAfterAnyBeginning) {
  PacketReader reader;
  const auto reports = readAll(reader, "PPP>A<BAAABAAABAAAAA><CAAACAAACAAAAA>");
  ASSERT_EQ(reports.size(), 2u);
  EXPECT_EQ(reports[0].encoder[0], 1);
  EXPECT_EQ(reports[1].encoder[0], 2);
  EXPECT_EQ(reader.stray(), 5u);
  EXPECT_EQ(reader.good(), 2u);
  EXPECT_EQ(reader.bad(), 0u);
}

TEST(FalconPacketReader, aByteLostOrTooManyCostsOnePacketOnly) {
  const std::string one = "<BAAABAAABAAAAA>", two = "<CAAACAAACAAAAA>";
  for (std::size_t at = 0; at < kPacketBytes; ++at)
    for (const bool is_lost : {true, false}) {
      if (at == 0 && !is_lost) continue;
      PacketReader reader;
      const auto reports = readAll(
          reader, one.substr(0, at) + (is_lost ? "" : "A") + one.substr(at + (is_lost ? 1 : 0)) + two + two);
      ASSERT_EQ(reports.size(), 2u) << at;
      EXPECT_EQ(reports[0].encoder[0], 2);
      EXPECT_EQ(reader.bad(), at == 0 ? 0u : 1u) << at;
      EXPECT_EQ(reader.badInARow(), 0u) << "good ones followed";
    }
}

TEST(FalconPacketReader, badInARowCountsUntilAGoodOne) {
  PacketReader reader;
  for (int i = 0; i < 25; ++i) readAll(reader, "<BAAAB?AABAAAAA>");
  EXPECT_EQ(reader.badInARow(), 25u);
  EXPECT_EQ(readAll(reader, "<BAAABAAABAAAAA>").size(), 1u);
  EXPECT_EQ(reader.badInARow(), 0u);
  EXPECT_EQ(reader.bad(), 25u);
}

TEST(FalconPacketReader, noiseNeverGivesMoreThanItHolds) {
  test::Random random(9);
  PacketReader reader;
  Report report;
  std::uint64_t reports = 0;
  for (int n = 0; n < 1'000'000; ++n)
    reports += reader.push(static_cast<std::uint8_t>(256 * random.unit()), report) ? 1 : 0;
  EXPECT_EQ(reports, reader.good());
  EXPECT_LT(reports, 3u) << "16 bytes of noise that fit the format are rarer than once in 10^17";
  EXPECT_EQ(readAll(reader, "<BAAABAAABAAAAA>").size(), 1u) << "and it recovers at once";
}

TEST(FalconPacket, modemBytesAtTheStartOfUsbPacketsAreSkipped) {
  // one read of three USB packets: 64, 64, 5 bytes
  std::vector<std::uint8_t> read(133);
  for (std::size_t i = 0; i < read.size(); ++i) read[i] = static_cast<std::uint8_t>(i);
  std::vector<std::uint8_t> payload;
  eachPayloadByte(read, [&](std::uint8_t byte) { payload.push_back(byte); });
  ASSERT_EQ(payload.size(), 62u + 62u + 3u);
  EXPECT_EQ(payload[0], 2);
  EXPECT_EQ(payload[61], 63);
  EXPECT_EQ(payload[62], 66);
  EXPECT_EQ(payload[124], 130);
  // nothing; and only the chip's own status bytes
  for (const std::size_t n : {0u, 1u, 2u}) {
    std::size_t count = 0;
    eachPayloadByte(std::span(read).first(n), [&](std::uint8_t) { ++count; });
    EXPECT_EQ(count, 0u);
  }
}

}  // namespace
}  // namespace needlelab::falcon
