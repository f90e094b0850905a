#include "common/gesture/column_coding.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <vector>

namespace needlelab::column_coding {
namespace {

// Packs rows after two given values, unpacks only the bytes, and compares. Returns the number of bytes.
template <typename U>
std::size_t roundTrip(const std::vector<U>& column) {
  const std::size_t rows = column.size() - 2;
  // the buffer is exactly as long as the code, so that a sanitizer detects a reader that goes beyond the end
  std::vector<std::uint8_t> room(kMaxColumnBytes<U> + kScribble);
  const auto* const end = packColumn(column.data() + 2, rows, room.data());
  const std::vector<std::uint8_t> bytes(room.data(), room.data() + (end - room.data()));
  if (bytes.empty()) {
    for (std::size_t i = 2; i < column.size(); ++i) EXPECT_EQ(column[i], column[1]);
    return 0;
  }
  std::vector<U> back{column[0], column[1]};
  back.resize(column.size());
  const auto* const stop = unpackColumn(bytes.data(), bytes.data() + bytes.size(), rows, back.data() + 2);
  EXPECT_EQ(stop, bytes.data() + bytes.size());
  EXPECT_EQ(back, column);
  EXPECT_EQ(skipColumn<U>(bytes.data(), bytes.data() + bytes.size(), rows), bytes.data() + bytes.size());
  for (std::size_t cut = 0; cut < bytes.size(); ++cut) {
    EXPECT_EQ(unpackColumn(bytes.data(), bytes.data() + cut, rows, back.data() + 2), nullptr) << cut;
    EXPECT_EQ(skipColumn<U>(bytes.data(), bytes.data() + cut, rows), nullptr) << cut;
  }
  return bytes.size();
}

template <typename U>
class ColumnCoding : public testing::Test {};
using Widths = testing::Types<std::uint32_t, std::uint64_t>;
TYPED_TEST_SUITE(ColumnCoding, Widths);

TYPED_TEST(ColumnCoding, everyWidthAndEveryNumberOfRows) {
  using U = TypeParam;
  std::mt19937_64 random(1);
  for (int width = 0; width <= static_cast<int>(8 * sizeof(U)); ++width)
    for (const std::size_t rows : {1u, 2u, 3u, 7u, 8u, 31u, 32u}) {
      std::vector<U> column(rows + 2, 5);
      for (std::size_t i = 2; i < column.size(); ++i)
        column[i] = width == 0 ? 5 : static_cast<U>(random() >> (64 - width));
      const std::size_t bytes = roundTrip(column);
      // at most a zig-zag level: head, base of up to width + 3 bits in groups of 7, packed rows (63 bits take
      // 64)
      const auto bits = static_cast<std::size_t>(width == 63 ? 64 : width);
      EXPECT_LE(bytes, 1 + (bits + 3 + 6) / 7 + (rows * bits + 7) / 8)
          << width << " bits, " << rows << " rows";
    }
}

TYPED_TEST(ColumnCoding, eachModeIsChosenWhereItIsGoodFor) {
  using U = TypeParam;
  const auto head = [](const std::vector<U>& column) {
    std::vector<std::uint8_t> room(kMaxColumnBytes<U> + kScribble);
    packColumn(column.data() + 2, column.size() - 2, room.data());
    return static_cast<int>(room[0]);
  };
  std::vector<U> column(34);
  // a level: noise around 1000, after a jump
  std::mt19937_64 random(2);
  for (std::size_t i = 2; i < column.size(); ++i) column[i] = static_cast<U>(1000 + random() % 4);
  EXPECT_EQ(head(column) >> 6, kFromLast);
  roundTrip(column);
  // steady motion: constant steps take no bits
  for (std::size_t i = 0; i < column.size(); ++i) column[i] = static_cast<U>(7 * i);
  EXPECT_EQ(head(column), kSecondDifference << 6);
  EXPECT_EQ(roundTrip(column), 1u);
  column[1] = column[0];
  EXPECT_EQ(head(column) >> 6, kFirstFromBase);
  roundTrip(column);
  // a random walk
  for (std::size_t i = 2; i < column.size(); ++i)
    column[i] = static_cast<U>(column[i - 1] + random() % 3 - 1);
  EXPECT_EQ(head(column) >> 6, kFirstDifference);
  roundTrip(column);
  // constant acceleration
  for (std::size_t i = 0; i < column.size(); ++i) column[i] = static_cast<U>(50 * i * i);
  EXPECT_EQ(head(column) >> 6, kSecondDifference);
  roundTrip(column);
}

TYPED_TEST(ColumnCoding, arithmeticWrapsAroundTheEnds) {
  using U = TypeParam;
  using S = SignedOf<U>;
  std::vector<U> column(34);
  for (std::size_t i = 0; i < column.size(); ++i)
    column[i] = static_cast<U>(i % 2 == 0 ? std::numeric_limits<S>::max() : std::numeric_limits<S>::min());
  roundTrip(column);
  for (std::size_t i = 0; i < column.size(); ++i)
    column[i] = static_cast<U>(i % 3 == 0 ? 0 : i % 3 == 1 ? ~U{0} : U{1} << (8 * sizeof(U) - 1));
  roundTrip(column);
}

TYPED_TEST(ColumnCoding, zigzagIsItsInverse) {
  using U = TypeParam;
  using S = SignedOf<U>;
  for (const S value :
       {S{0}, S{-1}, S{1}, S{-2}, std::numeric_limits<S>::max(), std::numeric_limits<S>::min()})
    EXPECT_EQ(static_cast<S>(unzigzag(zigzag(static_cast<U>(value)))), value);
  EXPECT_EQ(zigzag(static_cast<U>(S{-1})), 1u);
  EXPECT_EQ(zigzag(static_cast<U>(S{1})), 2u);
}

TEST(ColumnCodingHead, impossibleWidthIsRefused) {
  std::uint32_t v[34] = {};
  std::vector<std::uint8_t> bytes(400, 0);
  for (int width = 33; width <= 63; ++width) {
    bytes[0] = static_cast<std::uint8_t>(kFirstDifference << 6 | width);
    EXPECT_EQ(unpackColumn(bytes.data(), bytes.data() + bytes.size(), 32, v + 2), nullptr) << width;
  }
}

TEST(Varint, roundTripAndRefusals) {
  std::uint8_t bytes[16];
  for (const std::uint64_t value : {std::uint64_t{0}, std::uint64_t{127}, std::uint64_t{128},
                                    std::uint64_t{0xFFFFFFFF}, ~std::uint64_t{0}}) {
    const std::uint8_t* const end = putVarint(bytes, value);
    std::uint64_t back = 1;
    EXPECT_EQ(getVarint(bytes, end, 64, back), end);
    EXPECT_EQ(back, value);
    EXPECT_EQ(getVarint(bytes, end - 1, 64, back), nullptr);
    EXPECT_EQ(getVarint(bytes, end, 32, back) != nullptr, value <= 0xFFFFFFFF);
  }
  const std::uint8_t endless[16] = {0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80};
  std::uint64_t value = 0;
  EXPECT_EQ(getVarint(endless, endless + 16, 64, value), nullptr);
  EXPECT_EQ(getVarint(endless, endless, 64, value), nullptr);
}

}  // namespace
}  // namespace needlelab::column_coding
