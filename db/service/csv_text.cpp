#include "db/service/csv_text.h"

#include "common/base/text.h"

namespace needlelab {
namespace {

class CsvTextReader {
 public:
  explicit CsvTextReader(std::string_view text) : text_(text) {
    if (text_.starts_with("\xef\xbb\xbf")) text_.remove_prefix(3);
    const std::string_view first = text_.substr(0, text_.find('\n'));
    if (first.find(',') == std::string_view::npos && first.find(';') != std::string_view::npos)
      separator_ = ';';
  }

  [[nodiscard]] bool atEnd() const { return at_ >= text_.size(); }

  Result<CsvRow> row() {
    CsvRow row{line_, {}};
    for (;;) {
      auto cell = text_.substr(at_, 1) == "\"" ? quoted() : plain();
      if (!cell) return cell.error();
      row.cells.push_back(std::move(*cell));
      if (atEnd()) return row;
      const char c = text_[at_++];
      if (c == separator_) {
        while (!atEnd() && text_[at_] == ' ') ++at_;
        continue;
      }
      if (c == '\r' && !atEnd() && text_[at_] == '\n') ++at_;
      ++line_;
      return row;
    }
  }

 private:
  [[nodiscard]] bool endsCell(std::size_t at) const {
    return at >= text_.size() || text_[at] == separator_ || text_[at] == '\n' || text_[at] == '\r';
  }

  Result<std::string> plain() {
    const std::size_t from = at_;
    while (!endsCell(at_)) ++at_;
    std::string_view cell = text_.substr(from, at_ - from);
    while (cell.ends_with(' ')) cell.remove_suffix(1);
    while (cell.starts_with(' ')) cell.remove_prefix(1);
    return std::string(cell);
  }

  Result<std::string> quoted() {
    const std::uint32_t began = line_;
    std::string cell;
    for (++at_; !atEnd(); ++at_) {
      if (text_[at_] == '\n') ++line_;
      if (text_[at_] != '"') {
        cell += text_[at_];
        continue;
      }
      if (at_ + 1 < text_.size() && text_[at_ + 1] == '"') {
        cell += '"';
        ++at_;
        continue;
      }
      ++at_;
      if (endsCell(at_)) return cell;
      return Error{ErrorCode::kInvalidInput,
                   "csv: line " + std::to_string(line_) + ": something follows the closing quote of a cell"};
    }
    return Error{ErrorCode::kInvalidInput, "csv: line " + std::to_string(began) + ": a quote is not closed"};
  }

  std::string_view text_;
  std::size_t at_ = 0;
  std::uint32_t line_ = 1;
  char separator_ = ',';
};

}  // namespace

Result<std::vector<CsvRow>> parseCsvText(std::string_view text, std::size_t most_rows) {
  if (!isUtf8(text))
    return Error{ErrorCode::kInvalidInput, "csv: is not UTF-8: save the table as \"CSV UTF-8\""};
  std::vector<CsvRow> rows;
  CsvTextReader reader(text);
  while (!reader.atEnd()) {
    auto row = reader.row();
    if (!row) return row.error();
    rows.push_back(std::move(*row));
    if (rows.size() > most_rows)
      return Error{ErrorCode::kInvalidInput,
                   "csv: has more than " + std::to_string(most_rows) + " lines: split it"};
  }
  return rows;
}

}  // namespace needlelab
