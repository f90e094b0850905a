/// Rows of cells as spreadsheets and instruments write them: the one reader of CSV. Files are not trusted.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// What the bytes of a text file are written in.
enum class TextEncoding {
  kUnicode,      ///< UTF-8, or UTF-16 with a byte order mark
  kWindows1252,  ///< what spreadsheets of Western Europe call "CSV" or "ANSI"
};
/// Returns UTF-8 without a byte order mark. Errors (kInvalidInput, "FIELD: …"): the bytes are not of the
/// encoding; the message names the line and says what helps.
Result<std::string> utf8TextOf(std::string_view field, std::string bytes,
                               TextEncoding encoding = TextEncoding::kUnicode);

/// Cells are separated by commas, semicolons or tabs, whichever is most frequent in the first row outside of
/// quotes; a first line "sep=;" says it. A cell in double quotes may have separators and line ends; a doubled
/// quote is one. Lines end in LF, CRLF or CR. White space around cells and rows without any text are passed
/// over. Does not own the text; wipes what it copied of it, which may be a password. Thread: one.
class CsvRows {
 public:
  /// `text`: UTF-8 without a byte order mark. `lines_above`: lines above the header that are passed over.
  explicit CsvRows(std::string_view text, std::size_t lines_above = 0);
  ~CsvRows() { forget(); }
  CsvRows(const CsvRows&) = delete;
  CsvRows& operator=(const CsvRows&) = delete;

  /// Reads the next row; false at the end. kInvalidInput names the line: a quote that is not closed, text
  /// after a closing quote.
  Result<bool> next();
  /// Of the row that was read; valid until the next call.
  [[nodiscard]] std::span<const std::string_view> cells() const { return cells_; }
  /// The line at which it begins, from 1.
  [[nodiscard]] std::size_t line() const { return row_line_; }
  [[nodiscard]] char separator() const { return separator_; }

 private:
  void forget();
  bool findSeparator();
  [[nodiscard]] std::string_view lineFrom(std::size_t at) const;
  Status readQuoted(std::size_t end);
  void passLineEnd(std::size_t end);

  std::string_view text_;
  std::size_t at_ = 0, line_ = 1, row_line_ = 1;
  char separator_ = ',';
  std::vector<std::string_view> cells_;
  std::deque<std::string> unquoted_;  // what cells_ refers to beside the text
};

/// Whether a header's cell names the column `wanted`, such as "force_n": in any case, with its unit behind
/// it or in brackets ("Force [N]", "force_n (N)"). Another unit is another column.
bool isColumn(std::string_view header_cell, std::string_view wanted);
/// A number; with a decimal comma where the separator is none. Nothing: it is not one.
std::optional<double> csvNumber(std::string_view cell, char separator);
/// "the header reads 'a;b;c' …", for a message about a missing column.
std::string headerText(std::span<const std::string_view> cells, char separator);

}  // namespace needlelab
