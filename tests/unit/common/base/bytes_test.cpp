#include "common/base/bytes.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/random.h"

namespace needlelab {
namespace {

TEST(Bytes, integersAreLittleEndian) {
  Bytes out;
  ByteWriter writer(out);
  writer.put(std::uint32_t{0x01020304});
  writer.put(std::int16_t{-2});
  EXPECT_EQ(out, (Bytes{0x04, 0x03, 0x02, 0x01, 0xFE, 0xFF}));
}

TEST(Bytes, whatWasWrittenIsReadBackWithItsBits) {
  Bytes out;
  ByteWriter writer(out);
  writer.put(std::uint8_t{200});
  writer.put(std::numeric_limits<std::int64_t>::min());
  writer.put(-0.0);
  writer.put(1.5f);
  writer.put(viewOf("abc"));
  ByteReader reader(out);
  EXPECT_EQ(reader.get<std::uint8_t>(), 200);
  EXPECT_EQ(reader.get<std::int64_t>(), std::numeric_limits<std::int64_t>::min());
  EXPECT_EQ(std::bit_cast<std::uint64_t>(reader.get<double>()), 0x8000000000000000u);
  EXPECT_EQ(reader.get<float>(), 1.5f);
  EXPECT_EQ(textOf(reader.take(3)), "abc");
  EXPECT_TRUE(reader.ok());
  EXPECT_EQ(reader.left(), 0u);
}

TEST(ByteReader, everyCutGivesZerosAndNotOk) {
  Bytes out;
  ByteWriter(out).put(std::uint64_t{0x1122334455667788});
  for (std::size_t cut = 0; cut < out.size(); ++cut) {
    ByteReader reader(ByteView(out).first(cut));
    EXPECT_EQ(reader.get<std::uint64_t>(), 0u) << cut;
    EXPECT_FALSE(reader.ok()) << cut;
    EXPECT_EQ(reader.get<std::uint8_t>(), 0u)
        << "after the first failure nothing is read, though bytes are left";
  }
}

TEST(ByteReader, hostileLengthsCannotWrapAround) {
  const Bytes raw{1, 2, 3, 4};
  ByteReader reader(raw);
  ASSERT_EQ(reader.get<std::uint8_t>(), 1);
  EXPECT_TRUE(reader.take(std::numeric_limits<std::size_t>::max()).empty());
  EXPECT_FALSE(reader.ok());
}

// bit by bit, as the polynomial is defined
std::uint32_t literalCrc32c(ByteView bytes) {
  std::uint32_t crc = 0xFFFFFFFFu;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1u) ? 0x82F63B78u : 0u);
  }
  return ~crc;
}

TEST(Crc32c, checkValueAndVectorsOfRfc3720) {
  EXPECT_EQ(crc32c(viewOf("123456789")), 0xE3069283u);
  EXPECT_EQ(crc32c({}), 0u);
  const Bytes zeros(32, 0), ones(32, 0xFF);
  EXPECT_EQ(crc32c(zeros), 0x8A9136AAu);
  EXPECT_EQ(crc32c(ones), 0x62A8AB43u);
  Bytes rising(32);
  for (std::size_t i = 0; i < rising.size(); ++i) rising[i] = static_cast<std::uint8_t>(i);
  EXPECT_EQ(crc32c(rising), 0x46DD794Eu);
}

TEST(Crc32c, agreesWithTheDefinitionAtEveryLengthAndStart) {
  test::Random random(7);
  Bytes bytes(300);
  for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random.bits());
  for (std::size_t start = 0; start < 9; ++start)
    for (std::size_t length = 0; start + length <= 100; ++length) {
      const ByteView part = ByteView(bytes).subspan(start, length);
      ASSERT_EQ(crc32c(part), literalCrc32c(part)) << start << " " << length;
      ASSERT_EQ(crc32cByTables(part), literalCrc32c(part)) << start << " " << length;
    }
  EXPECT_EQ(crc32c(bytes), literalCrc32c(bytes));
}

TEST(Crc32c, continuesFromWhatWentBefore) {
  const auto whole = viewOf("a needle goes through six layers");
  for (std::size_t cut = 0; cut <= whole.size(); ++cut)
    for (const auto way : {&crc32c, &crc32cByTables})
      ASSERT_EQ(way(whole.subspan(cut), way(whole.first(cut), 0)), crc32c(whole)) << cut;
}

}  // namespace
}  // namespace needlelab
