#include "common/base/text/csv_rows.h"

#include <fmt/core.h>
#include <iconv.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <memory>

#include "common/base/secret.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

std::string_view trimmed(std::string_view text) {
  const auto isBlank = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && isBlank(text.front())) text.remove_prefix(1);
  while (!text.empty() && isBlank(text.back())) text.remove_suffix(1);
  return text;
}

/// Without the blanks that spreadsheets and pages put around numbers: of fixed width, narrow, of no width.
std::string_view withoutBlanks(std::string_view text) {
  constexpr std::string_view kBlanks[] = {" ",      "\t",     "\u00a0", "\u2007",
                                          "\u2009", "\u202f", "\u3000", "\ufeff"};
  const auto isPlain = [](char c) { return c > ' ' && c <= '~'; };
  while (!text.empty() && !(isPlain(text.front()) && isPlain(text.back()))) {
    const std::size_t size = text.size();
    for (const std::string_view blank : kBlanks) {
      if (text.starts_with(blank)) text.remove_prefix(blank.size());
      if (text.ends_with(blank)) text.remove_suffix(blank.size());
    }
    if (text.size() == size) break;
  }
  return text;
}

/// How many characters mark the text as a comment; 0: it is not a comment.
std::size_t commentSign(std::string_view text) {
  return text.starts_with('#') || text.starts_with('%') ? 1 : text.starts_with("//") ? 2 : 0;
}

/// Where a comment that follows after a blank begins; npos: nowhere.
std::size_t commentIn(std::string_view text) {
  for (std::size_t at = text.find_first_of(" \t"); at != std::string_view::npos;
       at = text.find_first_of(" \t", at + 1))
    if (commentSign(text.substr(at + 1)) > 0) return at;
  return std::string_view::npos;
}

/// Returns nothing if the bytes are not valid in the encoding.
std::optional<std::string> converted(std::string bytes, const char* from) {
  const iconv_t opened = ::iconv_open("UTF-8", from);
  if (opened == reinterpret_cast<iconv_t>(-1)) return std::nullopt;
  const std::unique_ptr<void, int (*)(iconv_t)> closed(opened, ::iconv_close);
  std::string text;
  std::array<char, 4096> out{};
  char* in = bytes.data();
  std::size_t in_left = bytes.size();
  while (in_left > 0) {
    char* to = out.data();
    std::size_t out_left = out.size();
    const std::size_t done = ::iconv(opened, &in, &in_left, &to, &out_left);
    text.append(out.data(), out.size() - out_left);
    if (done == static_cast<std::size_t>(-1) && errno != E2BIG) return std::nullopt;
  }
  return text;
}

/// The line of the first byte that is not UTF-8.
std::size_t lineOfFault(std::string_view bytes) {
  std::size_t line = 1;
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t end = std::min(bytes.find('\n', at), bytes.size());
    if (!isUtf8(bytes.substr(at, end - at))) break;
    at = end + 1;
    ++line;
  }
  return line;
}

}  // namespace

Result<std::string> utf8TextOf(std::string_view field, std::string bytes, TextEncoding encoding) {
  const auto fault = [&](const std::string& what) {
    return Error{ErrorCode::kInvalidInput, fmt::format("{}: {}", field, what)};
  };
  if (encoding == TextEncoding::kWindows1252) {
    if (auto text = converted(std::move(bytes), "WINDOWS-1252")) return *std::move(text);
    return fault("is not Windows-1252");
  }
  if (bytes.starts_with("\xff\xfe") || bytes.starts_with("\xfe\xff")) {
    if (auto text = converted(std::move(bytes), "UTF-16")) return *std::move(text);
    return fault("begins as UTF-16, and is cut or damaged");
  }
  if (const std::size_t mark = bytes.size() - withoutMark(bytes).size(); mark > 0) bytes.erase(0, mark);
  if (isUtf8(bytes)) return bytes;
  if (encoding == TextEncoding::kAsciiParts && bytes.find('\0') == std::string::npos)
    return converted(std::move(bytes), "ISO-8859-1").value_or("");
  return fault(
      fmt::format("line {}: is not UTF-8: save the table as \"CSV UTF-8\", or say what it is, for "
                  "example windows-1252 (--encoding)",
                  lineOfFault(bytes)));
}

CsvRows::CsvRows(std::string_view text, std::size_t lines_above, CommentLines comments)
    : text_(text), comments_(comments) {
  while (lines_above-- > 0 && at_ < text_.size()) passLineEnd(at_ + lineFrom(at_).size());
  constexpr std::string_view kSeparatorPrefix = "sep=";
  const std::string_view first = lineFrom(at_);
  if (first.size() == kSeparatorPrefix.size() + 1 && first.starts_with(kSeparatorPrefix)) {
    separator_ = first.back();
    passLineEnd(at_ + first.size());
    return;
  }
  if (comments == CommentLines::kYes) findHeader();
  while (at_ < text_.size() && !findSeparator()) passLineEnd(at_ + lineFrom(at_).size());
}

/// Goes to the first line that is no comment or, if that has a number, to the comment above it.
void CsvRows::findHeader() {
  std::size_t above = std::string_view::npos, above_line = 0;
  for (; at_ < text_.size(); passLineEnd(at_ + lineFrom(at_).size())) {
    const std::string_view line = trimmed(lineFrom(at_));
    if (const std::size_t sign = commentSign(line); sign > 0) {
      above = static_cast<std::size_t>(line.data() - text_.data()) + sign;
      above_line = line_;
    } else if (!line.empty()) {
      bool is_row = false;  // a cell is a number
      for (std::size_t from = 0; !is_row && from <= line.size();) {
        const std::size_t to = std::min(line.find_first_of(",;\t", from), line.size());
        is_row = numberOf(line.substr(from, to - from)).has_value();
        from = to + 1;
      }
      if (is_row && above != std::string_view::npos) at_ = above, line_ = above_line;
      return;
    }
  }
}

void CsvRows::forget() {
  cells_.clear();
  for (std::string& cell : unquoted_) wipe(cell);
  unquoted_.clear();
}

/// Finds the separator in the line at at_; false if the line has no text.
bool CsvRows::findSeparator() {
  const std::string_view line = lineFrom(at_);
  std::array<std::size_t, 3> counts{};
  constexpr std::string_view kSeparators = ",;\t";
  bool in_quotes = false, has_text = false;
  for (const char c : line) {
    if (c == '"') in_quotes = !in_quotes;
    const std::size_t kind = kSeparators.find(c);
    if (kind != std::string_view::npos && !in_quotes) ++counts[kind];
    has_text = has_text || (kind == std::string_view::npos && c != ' ');
  }
  const auto most = std::max_element(counts.begin(), counts.end());
  if (*most > 0) separator_ = kSeparators[static_cast<std::size_t>(most - counts.begin())];
  return has_text;
}

std::string_view CsvRows::lineFrom(std::size_t at) const {
  return text_.substr(at, text_.find_first_of("\r\n", at) - at);
}

void CsvRows::passLineEnd(std::size_t end) {
  at_ = end;
  if (at_ < text_.size() && text_[at_] == '\r') ++at_;
  if (at_ < text_.size() && text_[at_] == '\n' && (at_ == end || text_[at_ - 1] == '\r')) ++at_;
  ++line_;
}

Result<bool> CsvRows::next() {
  for (;;) {
    if (at_ >= text_.size()) return false;
    forget();
    row_line_ = line_;
    const std::string_view line = lineFrom(at_);
    const std::size_t end = at_ + line.size();
    if (comments_ == CommentLines::kYes && commentSign(trimmed(line)) > 0) {
      passLineEnd(end);
      continue;
    }
    if (line.find('"') == std::string_view::npos) {
      for (std::size_t from = 0;;) {
        const std::size_t to = std::min(line.find(separator_, from), line.size());
        cells_.push_back(trimmed(line.substr(from, to - from)));
        if (to == line.size()) break;
        from = to + 1;
      }
      passLineEnd(end);
    } else {
      RETURN_IF_ERROR(readQuoted(end));
    }
    if (std::all_of(cells_.begin(), cells_.end(), [](std::string_view cell) { return cell.empty(); }))
      continue;
    if (columns_ == 0) columns_ = cells_.size();
    const bool has_comment =
        comments_ == CommentLines::kYes && cells_.size() > columns_ &&
        (commentSign(cells_[columns_]) > 0 || commentIn(cells_[columns_ - 1]) != std::string_view::npos);
    if (has_comment) cells_.resize(columns_);
    return true;
  }
}

Status CsvRows::readQuoted(std::size_t end) {
  const auto fault = [&](std::size_t line, const char* what) {
    return Error{ErrorCode::kInvalidInput, fmt::format("line {}: {}", line, what)};
  };
  for (;;) {
    while (at_ < end && text_[at_] == ' ') ++at_;
    if (at_ >= end || text_[at_] != '"') {
      const std::size_t to = std::min(text_.substr(0, end).find(separator_, at_), end);
      cells_.push_back(trimmed(text_.substr(at_, to - at_)));
      at_ = to;
    } else {
      const std::size_t opened = line_;
      std::string& cell = unquoted_.emplace_back();
      for (++at_;; ++at_) {
        if (at_ >= text_.size()) return fault(opened, "a quote is not closed");
        if (text_[at_] == '"') {
          if (text_.substr(at_ + 1, 1) != "\"") break;
          ++at_;
        }
        if (text_[at_] == '\n') ++line_;
        cell += text_[at_];
      }
      ++at_;
      end = at_ + lineFrom(at_).size();
      while (at_ < end && text_[at_] == ' ') ++at_;
      if (at_ < end && text_[at_] != separator_)
        return fault(line_, "something follows the closing quote of a cell");
      cells_.push_back(cell);
    }
    if (at_ >= end) break;
    ++at_;  // the separator
  }
  passLineEnd(end);
  return {};
}

bool isColumn(std::string_view header_cell, std::string_view wanted) {
  std::string name = lowerCase(withoutBlanks(header_cell));
  std::string unit;
  const std::size_t open = name.find_first_of("[(");
  if (open != std::string::npos && (name.back() == ']' || name.back() == ')')) {
    unit = trimmed(std::string_view(name).substr(open + 1, name.size() - open - 2));
    name = trimmed(std::string_view(name).substr(0, open));
  }
  std::replace(name.begin(), name.end(), ' ', '_');
  std::replace(unit.begin(), unit.end(), '/', '_');
  const std::string column = lowerCase(wanted);
  if (unit.empty()) return name == column;
  return name + "_" + unit == column || (name == column && column.ends_with("_" + unit));
}

std::optional<double> numberOf(std::string_view text, char separator) {
  constexpr std::string_view kTrueMinus = "\u2212";
  text = withoutBlanks(text);
  const bool has_comma = separator != ',' && text.find(',') != std::string_view::npos;
  if (has_comma && text.find('.') != std::string_view::npos) return std::nullopt;
  std::string plain;
  if (has_comma || text.find(kTrueMinus) != std::string_view::npos) {
    plain = text;
    if (has_comma) std::replace(plain.begin(), plain.end(), ',', '.');
    for (std::size_t at; (at = plain.find(kTrueMinus)) != std::string::npos;)
      plain.replace(at, kTrueMinus.size(), "-");
    text = plain;
  }
  // std::from_chars takes no plus
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<double> csvNumber(std::string_view cell, char separator) {
  return numberOf(cell.substr(0, commentIn(cell)), separator);
}

std::string headerText(std::span<const std::string_view> cells, char separator) {
  constexpr std::size_t kMost = 120;
  std::string header;
  for (const std::string_view cell : cells) {
    if (!header.empty()) header += separator == '\t' ? ' ' : separator;
    header += cell;
  }
  return fmt::format("the header reads '{}{}', separated by {}", printable(header.substr(0, kMost)),
                     header.size() > kMost ? "…" : "",
                     separator == ','   ? "commas"
                     : separator == ';' ? "semicolons"
                                        : "tabs");
}

}  // namespace needlelab
