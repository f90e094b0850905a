/// Rows of the store as JSON records, one object each, and back: "kind" says which table. Exact both ways.
/// Private to this folder.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/connection.h"

namespace needlelab {

using RecordJson = nlohmann::ordered_json;

/// How a column is written.
enum class RecordColumnKind : std::uint8_t {
  kInteger,
  kReal,
  kText,
  kHex,      ///< bytes, as digits
  kSession,  ///< the row number of a session, as the session's id in digits
  kCounter,  ///< of a session: a whole number, which stands in session_progress while the session is open
};

struct RecordColumn {
  std::string_view name;
  RecordColumnKind kind = RecordColumnKind::kText;
  bool is_key = false;
  bool secret = false;  ///< hashes of passwords and keys: only when asked for
};

/// The name of a column in a record; the record's "kind" names the table.
std::string_view fieldOf(const RecordColumn& column);

struct RecordTable {
  std::string_view kind, table;
  std::span<const RecordColumn> columns;
  std::string_view only;  ///< a condition on the rows; empty: all
  std::string_view
      of_person;  ///< a condition on the rows that are a person's, its name as ?1; empty: none are
};

/// In an order in which they can be read in again: what is referred to comes first.
std::span<const RecordTable> recordTables();
/// Null for an unknown kind.
const RecordTable* recordTable(std::string_view kind);

/// "SELECT … FROM … WHERE … ORDER BY …" of a table's records; `where` may be empty.
std::string selectRecords(const RecordTable& table, std::string_view where, bool secrets);
/// The same, bound: of `person` (may be null) where the condition has a ?1, and only rows behind `keys`
/// (null: all), which are as keysOf() gave them. kInvalidInput.
Result<Statement> recordsAfter(Connection& connection, const RecordTable& table, const std::string& where,
                               const std::string* person, const RecordJson& keys, bool secrets);
/// The fields that a record is known by.
RecordJson keysOf(const RecordTable& table, const RecordJson& record);
/// The present row of such a statement.
RecordJson recordOf(const RecordTable& table, const Statement& row, bool secrets);

/// The row that has the record's key, as a record; null when no row has it. kInvalidInput: a key is missing
/// or of a wrong type.
Result<RecordJson> storedRecord(Connection& connection, const RecordTable& table, const RecordJson& record,
                                bool secrets);
/// Stores it. kInvalidInput: an unknown field, a wrong type, what the schema refuses.
Status insertRecord(Connection& writer, const RecordTable& table, const RecordJson& record);
Status removeRecord(Connection& writer, const RecordTable& table, const RecordJson& record);

// --- record_checks.cpp: what the schema cannot say of a record that is read in

/// kInvalidInput, naming the field: every field has its column's type, every text is one, numbers are in
/// their ranges. Never throws.
Status checkFields(const RecordTable& table, const RecordJson& record);
/// The same of what the fields hold, before a record is stored: names, and what is read later as JSON or as a
/// message. After checkFields().
Status checkRecord(const RecordTable& table, const RecordJson& record);

}  // namespace needlelab
