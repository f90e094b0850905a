/// Converts rows of the database to JSON records, without loss. One object per row; "kind" names the
/// table. Private to db/service.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

using RecordJson = nlohmann::ordered_json;

/// A column's JSON form.
enum class RecordColumnKind : std::uint8_t {
  kInteger,
  kReal,
  kText,
  kHex,      ///< bytes, as hexadecimal digits
  kSession,  ///< a session's row number, written as the session's id in digits
  kCounter,  ///< a session's whole-number counter, stored in session_progress while the session is open
  kPerson,   ///< people.ref, written as the name; an erased person's ref unchanged
};

struct RecordColumn {
  std::string_view name;
  RecordColumnKind kind = RecordColumnKind::kText;
  bool is_key = false;
  bool secret = false;  ///< hashes of passwords, codes and keys: exported only on request
};

struct RecordTable {
  std::string_view kind, table;
  std::span<const RecordColumn> columns;
  std::string_view only;       ///< a condition on the rows; empty: all
  std::string_view of_person;  ///< a condition that selects a person's rows, with the ref as ?1; empty: no
                               ///< row belongs to a person
};

/// Sorted so that each table follows those it refers to.
std::span<const RecordTable> recordTables();
/// The records that `where` (may be empty) selects from the table: of `person` (may be null) if the condition
/// has a ?1, and only rows after `keys` (null: all; form of keysOf()), `most` of them. kInvalidInput: the
/// session of `keys` is gone.
Result<Statement> recordsAfter(Connection& connection, const RecordTable& table, const std::string& where,
                               const std::string* person, const RecordJson& keys, bool secrets,
                               std::int64_t most);
/// The record's key fields.
RecordJson keysOf(const RecordTable& table, const RecordJson& record);
/// The current row of such a statement as a record.
RecordJson recordOf(const RecordTable& table, const Statement& row, bool secrets);

}  // namespace needlelab
