#include "common/base/bytes.h"

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace needlelab {
namespace {

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

TEST(Crc32c, everySingleBitFlipIsSeen) {
  Bytes bytes(64, 0x5A);
  const std::uint32_t good = crc32c(bytes);
  for (std::size_t bit = 0; bit < bytes.size() * 8; ++bit) {
    bytes[bit / 8] ^= static_cast<std::uint8_t>(1u << (bit % 8));
    ASSERT_NE(crc32c(bytes), good) << bit;
    bytes[bit / 8] ^= static_cast<std::uint8_t>(1u << (bit % 8));
  }
}

}  // namespace
}  // namespace needlelab
