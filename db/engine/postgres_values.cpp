#include "db/engine/postgres_values.h"

#include <fmt/core.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <string_view>
#include <type_traits>

namespace needlelab {
namespace {

template <typename Unsigned>
Unsigned bigEndian(ByteView bytes) {
  Unsigned value = 0;
  for (std::size_t i = 0; i < sizeof(Unsigned) && i < bytes.size(); ++i)
    value = static_cast<Unsigned>((value << 8) | bytes[i]);
  return value;
}

std::string bigEndianBytes(std::uint64_t value) {
  std::string bytes(8, '\0');
  for (std::size_t i = 0; i < 8; ++i) bytes[i] = static_cast<char>(value >> (56 - 8 * i));
  return bytes;
}

std::int64_t held(double value) {
  if (!(value > -0x1p63)) return std::numeric_limits<std::int64_t>::min();
  if (value >= 0x1p63) return std::numeric_limits<std::int64_t>::max();
  return static_cast<std::int64_t>(value);
}

/// numeric_send: number of digits (base 10,000), weight of the first, sign, scale; then the digits.
struct Numeric {
  bool negative = false, is_number = false;
  int weight = 0;
  ByteView digits;  ///< two bytes each
};

Numeric numericOf(ByteView bytes) {
  Numeric numeric;
  if (bytes.size() < 8) return numeric;
  const std::size_t count = bigEndian<std::uint16_t>(bytes);
  const auto sign = bigEndian<std::uint16_t>(bytes.subspan(4));
  if (bytes.size() < 8 + 2 * count || (sign != 0 && sign != 0x4000)) return numeric;  // NaN, infinities
  numeric.is_number = true;
  numeric.negative = sign != 0;
  numeric.weight = static_cast<std::int16_t>(bigEndian<std::uint16_t>(bytes.subspan(2)));
  numeric.digits = bytes.subspan(8, 2 * count);
  return numeric;
}

double realOf(const Numeric& numeric) {
  if (!numeric.is_number) return std::numeric_limits<double>::quiet_NaN();
  double value = 0;
  for (std::size_t i = 0; 2 * i < numeric.digits.size(); ++i)
    value += bigEndian<std::uint16_t>(numeric.digits.subspan(2 * i)) *
             std::pow(10'000.0, numeric.weight - static_cast<int>(i));
  return numeric.negative ? -value : value;
}

std::int64_t integerOf(const Numeric& numeric) {
  if (!numeric.is_number || numeric.weight < 0) return 0;
  constexpr auto kMax = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
  const std::int64_t beyond =
      numeric.negative ? std::numeric_limits<std::int64_t>::min() : std::numeric_limits<std::int64_t>::max();
  std::uint64_t value = 0;
  for (int i = 0; i <= numeric.weight; ++i) {
    const auto at = static_cast<std::size_t>(2 * i);
    const std::uint64_t digit =
        at < numeric.digits.size() ? bigEndian<std::uint16_t>(numeric.digits.subspan(at)) : 0;
    if (value > (kMax - digit) / 10'000) return beyond;
    value = value * 10'000 + digit;
  }
  const auto magnitude = static_cast<std::int64_t>(value);
  return numeric.negative ? -magnitude : magnitude;
}

std::int64_t wholeNumberIn(std::string_view text) {
  std::int64_t value = 0;
  (void)std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

void putBigEndian32(std::string& into, std::size_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) into += static_cast<char>((value >> shift) & 0xff);
}

/// array_recv: dimensions, NULL flag, element type; the dimension's length and first index; then each element
/// after its length. `bytes_of` gives an element's bytes.
template <typename Value, typename BytesOf>
std::optional<std::string> listOf(PostgresType element, std::span<const Value> values,
                                  const BytesOf& bytes_of) {
  constexpr std::size_t kMostBytes = (std::size_t{1} << 30) - 1024;
  std::size_t bytes = 20;
  for (const Value& value : values) bytes += 4 + bytes_of(value).size();
  if (bytes > kMostBytes) return std::nullopt;
  std::string list;
  list.reserve(bytes);
  putBigEndian32(list, values.empty() ? 0 : 1);
  putBigEndian32(list, 0);
  putBigEndian32(list, static_cast<std::size_t>(element));
  if (values.empty()) return list;
  putBigEndian32(list, values.size());
  putBigEndian32(list, 1);
  for (const Value& value : values) {
    const auto& of = bytes_of(value);
    putBigEndian32(list, of.size());
    list.append(reinterpret_cast<const char*>(of.data()), of.size());
  }
  return list;
}

}  // namespace

std::optional<std::string> postgresList(std::span<const std::int64_t> values) {
  return listOf(PostgresType::kInt8, values, [](std::int64_t value) { return postgresInteger(value); });
}

std::optional<std::string> postgresList(std::span<const std::string_view> values) {
  return listOf(PostgresType::kText, values, [](std::string_view value) { return value; });
}

std::optional<std::string> postgresList(std::span<const ByteView> values) {
  return listOf(PostgresType::kBytes, values, [](ByteView value) { return value; });
}

std::string postgresInteger(std::int64_t value) {
  return bigEndianBytes(static_cast<std::uint64_t>(value));
}

std::string postgresReal(double value) {
  return bigEndianBytes(std::bit_cast<std::uint64_t>(value));
}

std::int64_t integerOfPostgres(PostgresType type, ByteView bytes) {
  switch (type) {
    case PostgresType::kBool:
      return !bytes.empty() && bytes[0] != 0 ? 1 : 0;
    case PostgresType::kInt8:
      return static_cast<std::int64_t>(bigEndian<std::uint64_t>(bytes));
    case PostgresType::kInt4:
      return static_cast<std::int32_t>(bigEndian<std::uint32_t>(bytes));
    case PostgresType::kOid:
      return bigEndian<std::uint32_t>(bytes);
    case PostgresType::kInt2:
      return static_cast<std::int16_t>(bigEndian<std::uint16_t>(bytes));
    case PostgresType::kFloat4:
    case PostgresType::kFloat8:
      return held(realOfPostgres(type, bytes));
    case PostgresType::kNumeric:
      return integerOf(numericOf(bytes));
    case PostgresType::kText:
    case PostgresType::kVarchar:
    case PostgresType::kName:
      return wholeNumberIn(textOf(bytes));
    default:
      return 0;
  }
}

double realOfPostgres(PostgresType type, ByteView bytes) {
  switch (type) {
    case PostgresType::kFloat8:
      return std::bit_cast<double>(bigEndian<std::uint64_t>(bytes));
    case PostgresType::kFloat4:
      return static_cast<double>(std::bit_cast<float>(bigEndian<std::uint32_t>(bytes)));
    case PostgresType::kNumeric:
      return realOf(numericOf(bytes));
    case PostgresType::kText:
    case PostgresType::kVarchar:
      return std::strtod(std::string(textOf(bytes)).c_str(), nullptr);
    default:
      return static_cast<double>(integerOfPostgres(type, bytes));
  }
}

std::optional<std::string> textOfPostgres(PostgresType type, ByteView bytes) {
  switch (type) {
    case PostgresType::kBool:
    case PostgresType::kInt2:
    case PostgresType::kInt4:
    case PostgresType::kInt8:
    case PostgresType::kOid:
      return std::to_string(integerOfPostgres(type, bytes));
    case PostgresType::kFloat4:
    case PostgresType::kFloat8:
      return fmt::format("{}", realOfPostgres(type, bytes));
    case PostgresType::kNumeric: {
      const Numeric numeric = numericOf(bytes);
      const double value = realOf(numeric);
      if (value == std::floor(value) && std::abs(value) < 9e18) return std::to_string(integerOf(numeric));
      return fmt::format("{}", value);
    }
    default:
      return std::nullopt;
  }
}

namespace {

/// The position after the text, name or comment that begins at `at`; `at` if none begins there.
std::size_t behindQuoted(std::string_view sql, std::size_t at) {
  if (sql[at] == '\'' || sql[at] == '"') {
    // a doubled quote is treated as the start of the next text
    const std::size_t end = sql.find(sql[at], at + 1);
    return end == std::string_view::npos ? sql.size() : end + 1;
  }
  if (sql.substr(at, 2) == "--") return std::min(sql.find('\n', at), sql.size());
  return at;
}

}  // namespace

PostgresSql forPostgres(std::string_view sql) {
  constexpr std::string_view kNotIndexed = " NOT INDEXED";
  PostgresSql made;
  std::string& text = made.text;
  int& greatest = made.parameters;
  text.reserve(sql.size() + 16);
  for (std::size_t at = 0; at < sql.size();) {
    if (const std::size_t behind = behindQuoted(sql, at); behind > at) {
      text += sql.substr(at, behind - at);
      at = behind;
      continue;
    }
    if (sql.substr(at, kNotIndexed.size()) == kNotIndexed) {
      at += kNotIndexed.size();
      continue;
    }
    if (sql[at] != '?') {
      text += sql[at++];
      continue;
    }
    ++at;
    int number = 0;
    for (; at < sql.size() && std::isdigit(static_cast<unsigned char>(sql[at])) != 0 && number < 100'000;
         ++at)
      number = number * 10 + (sql[at] - '0');
    if (number == 0) number = greatest + 1;
    greatest = std::max(greatest, number);
    text += '$' + std::to_string(number);
  }
  return made;
}

}  // namespace needlelab
