#include "common/base/bytes.h"

#include <gtest/gtest.h>

#include <limits>

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

}  // namespace
}  // namespace needlelab
