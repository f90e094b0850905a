/// A class as a table of people: parses and checks its cells, without the database. Private to db/service.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/csv_rows.h"
#include "db/people/people.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// What a table program has made of digits that are a name: "4.71221E+11" is "a number that …", and so is
/// "471221.0"; "" for any other text.
std::string madeByTableProgram(std::string_view text);

/// Limit on the memberships named in one table, and on the total size of the groups it adds people to: the
/// writer stores all of them again, for which others wait about 0.5 s.
inline constexpr std::size_t kMaxImportMemberships = 20'000;
inline constexpr std::size_t kMaxImportRows = 5000;
/// Passwords and codes; each takes 0.1 s to hash.
inline constexpr std::size_t kMaxImportSecrets = 200;

/// A column's name as it is reported; the rest is cut.
inline constexpr std::size_t kMaxColumnBytes = 200;

/// A person to import: a row, or several that differ only in the group.
struct ImportRow {
  std::uint32_t line = 0;  ///< the first
  Person person;
  std::string password, code;
  std::vector<std::string> groups;
  pb::PeopleImport::What what = pb::PeopleImport::ADD;
  std::string text, column;  ///< the problem and its column
  bool role_given = false, full_name_given = false, has_password = false, has_code = false;
  bool role_changes = false;
  bool code_taken = false;  ///< the code is accepted as the person's
  /// What a person should look at before the import, and its column.
  std::string question, asked_column;
  std::vector<std::string> new_groups;  ///< those of `groups` that neither the store nor an earlier row has

  /// For compared rows: see people_import.cpp.
  [[nodiscard]] bool givesRights() const {
    const bool is_new = what == pb::PeopleImport::ADD;
    return (is_new && (person.role != pb::TRAINEE || has_password)) ||
           ((is_new || what == pb::PeopleImport::CHANGE) && (role_changes || code_taken));
  }

  void fault(const std::string& in_column, const std::string& words) {
    if (what == pb::PeopleImport::FAULT) return;
    what = pb::PeopleImport::FAULT;
    column = in_column;
    text = words;
  }
};

/// A named column of the header.
struct ImportColumn {
  std::string cell;  ///< as written, printable
  /// name, full_name, given_name, family_name, role, group, password, code; "": ignored
  std::string taken_as;
};

/// Reads a table and checks each row on its own. Wipes its secrets on destruction. Thread: a single one.
class ImportTable {
 public:
  /// `now_unix_ns`: creation time of the people in its rows.
  explicit ImportTable(std::int64_t now_unix_ns) : now_unix_ns_(now_unix_ns) {}
  ImportTable(const ImportTable&) = delete;
  ImportTable& operator=(const ImportTable&) = delete;
  ~ImportTable() { wipeSecrets(); }

  /// Columns may have other words in English, German or French, and unknown ones are ignored. kInvalidInput:
  /// a fault of the table as a whole. Faults of rows are noted in them; a header without the account is the
  /// only row.
  Status read(const std::string& csv, std::size_t lines_above);
  [[nodiscard]] std::vector<ImportRow>& rows() { return rows_; }
  [[nodiscard]] const std::vector<ImportRow>& rows() const { return rows_; }
  /// The header's columns, if one of them is ignored or has another word than needlelab's own; otherwise
  /// none.
  [[nodiscard]] std::span<const ImportColumn> foreignColumns() const {
    return in_own_words_ ? std::span<const ImportColumn>() : header_;
  }
  /// The header's line, from 1.
  [[nodiscard]] std::uint32_t headerLine() const { return header_line_; }
  void wipeSecrets();

 private:
  [[nodiscard]] Status checkMemberships() const;
  void faultEqualCodes();
  /// Asks about numbers shorter than most of their column: a table program drops zeros at the left.
  void askAboutLengths(const std::string& column, const std::function<std::string(const ImportRow&)>& textOf);
  /// Whether the row is one more group of a person of another row, which then has it.
  bool joinRow(ImportRow& row);
  Status readHeader(bool is_there, const CsvRows& rows);
  void add(const CsvRows& rows);

  const std::int64_t now_unix_ns_;
  std::map<std::string, std::size_t, std::less<>> columns_;
  std::vector<ImportColumn> header_;
  std::uint32_t header_line_ = 0;
  bool in_own_words_ = true;
  std::vector<std::size_t> unnamed_;          ///< columns without a name
  std::size_t width_ = 0;                     ///< cells in the header, up to its last name
  std::map<std::string, std::size_t> lines_;  ///< indices into rows_, by nameKey()
  std::vector<ImportRow> rows_;
};

}  // namespace needlelab
