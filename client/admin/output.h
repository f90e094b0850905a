/// The tool's output, from the same rows: tables for people, or one JSON object for programs.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

using Json = nlohmann::ordered_json;

/// A column of a table: the key in the rows' JSON, the title and the format.
struct Column {
  enum class Kind {
    kPlain,
    kTime,     ///< ns since 1970, shown as local time to the second
    kBytes,    ///< shown in kB, MB …
    kVerdict,  ///< "passed" or true; otherwise not passed. Shown in the words of verdictName
  };
  std::string_view key;
  std::string_view title;
  Kind kind = Kind::kPlain;
};

/// Prints results and messages. Thread: one.
class Output {
 public:
  /// `json_file`: nothing = tables; empty = JSON to `out`; else JSON to that file.
  Output(std::ostream& out, std::ostream& err, std::optional<std::string> json_file)
      : out_(out), err_(err), json_file_(std::move(json_file)) {}

  /// `rows`: a JSON array of objects. A table shows only the given columns; JSON contains everything:
  /// {"version", "machine", "rows"}. `if_empty` replaces a table without rows.
  Status list(const std::vector<Column>& columns, const Json& rows, std::string_view if_empty = "nothing");
  /// One object: "key value" lines for people (the given columns, in order), or JSON with one row.
  Status one(const std::vector<Column>& columns, const Json& row);
  /// Like `one`, for a row with a secret: only the file's owner may read it.
  Status oneSecret(const std::vector<Column>& columns, const Json& row);
  /// Prints more text for people, e.g. after one(); nothing with JSON.
  void text(std::string_view line);
  /// Prints a requested document, e.g. an export, even with JSON.
  void document(std::string_view text);
  /// "key added" and the like: to `out`, or to `err` when JSON goes to `out`.
  void done(std::string_view line);
  /// Prints to `err`.
  void remark(std::string_view line);
  [[nodiscard]] bool json() const { return json_file_.has_value(); }

 private:
  Status writeJson(const Json& rows, unsigned mode = 0600);
  void lines(const std::vector<Column>& columns, const Json& row);
  std::ostream& out_;
  std::ostream& err_;
  std::optional<std::string> json_file_;
};

/// 12 B, 3.4 kB, 5.6 MB …
std::string bytesText(std::uint64_t bytes);
/// Makes a text safe for a terminal: control characters and line ends become spaces, hidden characters are
/// written out (showHidden).
std::string oneLine(std::string_view text);

/// Reads a stored JSON text; null if it is invalid.
Json storedJson(std::string_view text);

/// Returns a table as text, one line per row; used by Output and for tables inside other texts.
std::string tableText(const std::vector<Column>& columns, const Json& rows);

}  // namespace needlelab
