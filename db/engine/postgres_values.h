/// PostgreSQL's binary value formats (its source: src/backend/utils/adt, functions *send and *recv).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/base/bytes.h"

namespace needlelab {

/// Types by their OIDs (pg_type.dat).
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

/// 8 bytes, big-endian.
std::string postgresInteger(std::int64_t value);
std::string postgresReal(double value);
/// A one-dimensional array (array_send). Nothing if it would exceed PostgreSQL's limit of 1 GiB.
std::optional<std::string> postgresList(std::span<const std::int64_t> values);
std::optional<std::string> postgresList(std::span<const std::string_view> values);
std::optional<std::string> postgresList(std::span<const ByteView> values);

/// The value as an integer, as SQLite would convert it: the leading number of a text; the integral part of a
/// numeric or real, clamped to 64 bits; 0 for anything else. `bytes` come from a server and may have any
/// length.
std::int64_t integerOfPostgres(PostgresType type, ByteView bytes);
/// The value as a real number, likewise.
double realOfPostgres(PostgresType type, ByteView bytes);
/// The digits of a number, as SQLite would convert it to text. Nothing: `bytes` already are the text or
/// bytes.
std::optional<std::string> textOfPostgres(PostgresType type, ByteView bytes);

}  // namespace needlelab
