/// A course's results for a spreadsheet: one wide table with a row for each person and exercise, and a column
/// for each measure that the course requires.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/csv.h"
#include "common/base/units.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// The unit in which all values of a measure are shown in one column: mm, mm/s, mJ, cm², °, s, N, % for
/// shares, none for counts. `name`: of a score's row; unknown ones are not converted.
ShownUnit columnUnitOf(std::string_view name);

/// CSV by RFC 4180, UTF-8 with a byte order mark. Columns: person, full name, groups (separated by "; "),
/// exercise, verdict (verdictName(), "not tried", "excused": no attempt counts), attempts that count,
/// attempts left (empty: unlimited), number and date of the best attempt (spreadsheetTime()); then each
/// measure with its unit, from the best attempt's first score; empty if missing there. Thread: one at a time.
class ResultTable {
 public:
  explicit ResultTable(const CsvStyle& style) : style_(style) {}

  /// Appends the byte order mark and the header. `first`: the first page of GetResults with `with_measures`;
  /// it defines the columns and the exercises' names for all rows.
  void begin(std::string& out, const pb::Results& first);
  /// Appends one row. kCorrupt: the stored score is invalid; nothing is added.
  Status add(std::string& out, const pb::ResultRow& person, const pb::ResultCell& cell) const;

 private:
  CsvStyle style_;
  std::vector<std::string> measures_;
  std::map<std::string, std::string> exercise_names_;  ///< by id
};

}  // namespace needlelab
