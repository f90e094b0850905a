/// Converts rows of the database to JSON records and back, without loss. One object per row; "kind" names the
/// table. Private to this folder.
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

/// A field's text; empty when it is absent or of another type.
std::string textIn(const RecordJson& record, const char* name);
/// A field's whole number; 0 when it is absent or of another type.
std::int64_t numberIn(const RecordJson& record, const char* name);
/// Whether the field is there and not null.
bool isGiven(const RecordJson& record, const char* name);

/// A column's JSON form.
enum class RecordColumnKind : std::uint8_t {
  kInteger,
  kReal,
  kText,
  kHex,      ///< bytes, as hexadecimal digits
  kSession,  ///< a session's row number, written as the session's id in digits
  kCounter,  ///< a session's whole-number counter, stored in session_progress while the session is open
  kMark,     ///< of an erasure: 1 when nobody had the name, 0; a row of `meta` (erasure.h), and no column
};

struct RecordColumn {
  std::string_view name;
  RecordColumnKind kind = RecordColumnKind::kText;
  bool is_key = false;
  bool secret = false;  ///< hashes of passwords, codes and keys: exported only on request
  /// For a column that the first exports did not have, at the end of its table: what such a record means, as
  /// JSON.
  std::string_view of_older = {};
};

/// A column's name in a record. The record's "kind" names the table.
std::string_view fieldOf(const RecordColumn& column);

struct RecordTable {
  std::string_view kind, table;
  std::span<const RecordColumn> columns;
  std::string_view only;       ///< a condition on the rows; empty: all
  std::string_view of_person;  ///< a condition that selects a person's rows, with the name as ?1; empty: no
                               ///< row belongs to a person
};

/// In import order: a table comes after the tables that it refers to.
std::span<const RecordTable> recordTables();
/// Null for an unknown kind.
const RecordTable* recordTable(std::string_view kind);

/// "SELECT … FROM … WHERE … ORDER BY …" for a table's records; `where` may be empty.
std::string selectRecords(const RecordTable& table, std::string_view where, bool secrets);
/// The same, with bound values: of `person` (may be null) where the condition has a ?1, and only rows after
/// `keys` (null: all), in the form of keysOf(), `most` of them. kInvalidInput.
Result<Statement> recordsAfter(Connection& connection, const RecordTable& table, const std::string& where,
                               const std::string* person, const RecordJson& keys, bool secrets,
                               std::int64_t most);
/// Adds the columns that exports of older programs did not have. A record with a secret must have the table's
/// other secrets too: `secrets`.
void fillOlder(const RecordTable& table, RecordJson& record, bool secrets);
/// The record's key fields.
RecordJson keysOf(const RecordTable& table, const RecordJson& record);
/// The current row of such a statement, as a record.
RecordJson recordOf(const RecordTable& table, const Statement& row, bool secrets);

/// The stored row with the record's key, as a record; null when no row has that key. kInvalidInput: a key is
/// missing or has a wrong type.
Result<RecordJson> storedRecord(Connection& connection, const RecordTable& table, const RecordJson& record,
                                bool secrets);
/// Stores the record, but for marks. Returns the new row's `number`, a whole-number column of the table;
/// empty: 0. kInvalidInput: an unknown field, a wrong type, a violation of the schema.
Result<std::int64_t> insertRecord(Connection& writer, const RecordTable& table, const RecordJson& record,
                                  std::string_view number = {});
Status removeRecord(Connection& writer, const RecordTable& table, const RecordJson& record);

/// Removes the pieces of imports whose program was killed: those whose last one came more than a day ago. A
/// row in the position kDroppedPieces (erasure.h) stands for them for 31 days. Writer's connection.
Status dropOldImports(Connection& writer, std::int64_t now_unix_ns);

// --- record_checks.cpp: checks of imported records beyond the schema

/// kInvalidInput, naming the field, unless every field has its column's type, every text is valid and numbers
/// are in range. Never throws.
Status checkFields(const RecordTable& table, const RecordJson& record);
/// Checks the fields' contents before a record is stored: names, JSON texts and stored messages. After
/// checkFields().
Status checkRecord(const RecordTable& table, const RecordJson& record);

}  // namespace needlelab
