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

/// The encoding of a text file.
enum class TextEncoding {
  kUnicode,      ///< UTF-8, or UTF-16 with a byte order mark
  kWindows1252,  ///< Western European spreadsheets call it "CSV" or "ANSI"
  kAsciiParts,   ///< kUnicode, or any one with the letters of ASCII: for those who read no other letters
};
/// "unicode", "windows-1252": of an option --encoding.
inline constexpr const char* kEncodingNames[] = {"unicode", "windows-1252"};
/// Returns UTF-8 without a byte order mark. Errors (kInvalidInput, "FIELD: …"): the bytes are not valid in
/// the encoding; the message names the line and the remedy. kAsciiParts: Latin-1 unless it is Unicode.
Result<std::string> utf8TextOf(std::string_view field, std::string bytes,
                               TextEncoding encoding = TextEncoding::kUnicode);

/// Whether lines that begin with #, % or // are comments, as in tables of numbers. The header may begin so,
/// if a cell of the line below it is a number; a row may end so.
enum class CommentLines { kNo, kYes };

/// The separator is a comma, semicolon or tab: the most frequent one outside quotes in the first row, unless
/// a first line such as "sep=;" names it. A cell in double quotes may contain separators and line ends; a
/// doubled quote stands for one. Lines end in LF, CRLF or CR. Ignores white space around cells and rows
/// without text. Does not own the text; wipes the parts that it copied, which may hold a password. Thread:
/// one.
class CsvRows {
 public:
  /// `text`: UTF-8 without a byte order mark. `lines_above`: lines to skip above the header.
  explicit CsvRows(std::string_view text, std::size_t lines_above = 0,
                   CommentLines comments = CommentLines::kNo);
  ~CsvRows() { forget(); }
  CsvRows(const CsvRows&) = delete;
  CsvRows& operator=(const CsvRows&) = delete;

  /// Reads the next row; false at the end. kInvalidInput names the line: a quote that is not closed, text
  /// after a closing quote.
  Result<bool> next();
  /// The cells of the row just read; valid until the next call.
  [[nodiscard]] std::span<const std::string_view> cells() const { return cells_; }
  /// The line at which the row begins, from 1.
  [[nodiscard]] std::size_t line() const { return row_line_; }
  [[nodiscard]] char separator() const { return separator_; }

 private:
  void forget();
  bool findSeparator();
  void findHeader();
  [[nodiscard]] std::string_view lineFrom(std::size_t at) const;
  Status readQuoted(std::size_t end);
  void passLineEnd(std::size_t end);

  std::string_view text_;
  std::size_t at_ = 0, line_ = 1, row_line_ = 1;
  char separator_ = ',';
  CommentLines comments_;
  std::size_t columns_ = 0;  // of the header
  std::vector<std::string_view> cells_;
  std::deque<std::string> unquoted_;  // what cells_ refers to besides the text
};

/// Whether a header's cell names the column `wanted`, such as "force_n": in any case, with its unit after it
/// or in brackets ("Force [N]", "force_n (N)"). A different unit means a different column.
bool isColumn(std::string_view header_cell, std::string_view wanted);
/// Reads a number as people, instruments and spreadsheets write it: the one reader of decimal numbers. Takes
/// a leading plus, the true minus (U+2212), white space of Unicode around it, and a decimal comma unless the
/// comma is the separator. Nothing if the text is not a number.
std::optional<double> numberOf(std::string_view text, char separator = ',');
/// As numberOf; a comment (CommentLines) may follow after a blank.
std::optional<double> csvNumber(std::string_view cell, char separator);
/// "the header reads 'a;b;c' …", for a message about a missing column.
std::string headerText(std::span<const std::string_view> cells, char separator);

}  // namespace needlelab
