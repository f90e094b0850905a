/// PostgreSQL's binary forms of values (its source: src/backend/utils/adt, the functions *send and *recv).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/base/bytes.h"

namespace needlelab {

/// Types by their numbers in PostgreSQL's catalogue (pg_type.dat).
enum class PostgresType : std::uint32_t {
  kUnspecified = 0,
  kBool = 16,
  kBytes = 17,
  kName = 19,
  kInt8 = 20,
  kInt2 = 21,
  kInt4 = 23,
  kText = 25,
  kOid = 26,
  kFloat4 = 700,
  kFloat8 = 701,
  kVarchar = 1043,
  kNumeric = 1700,
  kBytesList = 1001,  // arrays
  kTextList = 1009,
  kInt8List = 1016,
};

/// 8 bytes, greatest first.
std::string postgresInteger(std::int64_t value);
std::string postgresReal(double value);
/// An array of one dimension (array_send). Nothing: it would have more than the 1 GiB that PostgreSQL takes.
std::optional<std::string> postgresList(std::span<const std::int64_t> values);
std::optional<std::string> postgresList(std::span<const std::string_view> values);
std::optional<std::string> postgresList(std::span<const ByteView> values);

/// The value as a whole number, as SQLite would give it: of a text what it begins with; of a numeric and a
/// real what is before the point, held to the range of 64 bits; of anything else 0. `bytes` come from a
/// server and may have any length.
std::int64_t integerOfPostgres(PostgresType type, ByteView bytes);
/// As a real number, in the same way.
double realOfPostgres(PostgresType type, ByteView bytes);
/// The digits of a number, as SQLite would give them as a text. Nothing: `bytes` are the text, or the bytes.
std::optional<std::string> textOfPostgres(PostgresType type, ByteView bytes);

}  // namespace needlelab
