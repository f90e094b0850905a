/// Tables of texts (RFC 4180), as spreadsheets write them. Private to this folder. Tables of numbers:
/// base/csv.h.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

struct CsvRow {
  std::uint32_t line = 0;  ///< where it begins, from 1
  std::vector<std::string> cells;
};

/// Cells between commas, or between semicolons where the first line has those and no comma; in double quotes
/// where they hold one, quotes doubled, line ends allowed within. Lines end in LF or CRLF; a byte order mark
/// is passed over; spaces around a cell without quotes are not part of it. Errors (kInvalidInput) name the
/// line: no UTF-8, a quote that is not closed or has something behind it, more than `most_rows`.
Result<std::vector<CsvRow>> parseCsvText(std::string_view text, std::size_t most_rows);

}  // namespace needlelab
